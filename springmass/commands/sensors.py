"""``springmass sensors``: the families of rangefinders and their limits."""

from __future__ import annotations

import json

from acquisition.decoders.registry import families
from springmass.commands.options import Json
from springmass.errors import OK, suggest
from springmass.terminal.printing import wrapped


def sensors(*, as_json: Json = False) -> int:
    """Print every family with rate, resolution, range and limits."""
    if as_json:
        print(json.dumps([family.describe() for family in families()]))
        return OK
    print(f"{'name':<18} {'rate / Hz':>9} {'step / mm':>9} {'range / m':>13} {'baud':>7}")
    for family in families():
        near, far = family.range_m
        reach = f"{near:g} to {far:g}"
        step = f"{family.resolution_m * 1e3:.3g}"
        print(f"{family.name:<18} {family.rate_hz:>9.3g} {step:>9} {reach:>13} {family.baud:>7}")
        print(wrapped(f"    {family.title}. {family.limits}", "    "))
    suggest("springmass ports tells which of them speaks, and where")
    return OK
