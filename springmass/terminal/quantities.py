"""Quantities as a person reads them: a prefix that leaves few zeros, ± or the digits in parentheses."""

from __future__ import annotations

from pipeline.numerics.estimate import Estimate, format_value, in_brackets
from springmass.report.tables import page_unit, pretty
from springmass.report.words import typeset
from springmass.terminal.look import Look

__all__ = ["concise", "prefixed", "shown"]

# Unit to (below this size, factor, unit with its prefix), the smallest first. Periods stay in seconds down to 0.1 s.
_PREFIXES = {
    "m": ((1e-3, 1e6, "µm"), (1.0, 1e3, "mm")),
    "kg": ((1e-3, 1e6, "mg"), (1.0, 1e3, "g")),
    "s": ((1e-3, 1e6, "µs"), (0.1, 1e3, "ms")),
    "m/s": ((1e-4, 1e6, "µm/s"), (0.1, 1e3, "mm/s")),
}


def prefixed(estimate: Estimate) -> Estimate:
    """Return an estimate in the unit with the prefix that leaves 1 to 1000 in front of it; most units have none.

    Examples
    --------
    >>> prefixed(Estimate(0.05145, 2e-5, "m"))
    51.450(20) mm
    """
    for below, factor, unit in _PREFIXES.get(estimate.unit, ()):
        if 0.0 < abs(estimate.value) < below:
            return Estimate(float(f"{estimate.value * factor:.15g}"), float(f"{estimate.u * factor:.15g}"), unit)
    return estimate


def shown(estimate: Estimate | None, look: Look) -> str:
    """Return an estimate for a stream: plain SI for a pipe, with prefix and ± where the terminal can."""
    if estimate is None:
        return "-"
    chosen = estimate if look.si else prefixed(estimate)
    if look.unicode:
        return pretty(chosen)
    return format_value(chosen.value, chosen.u, chosen.unit.replace("µ", "u"))


def concise(estimate: Estimate | None, look: Look) -> str:
    """Return an estimate with its uncertainty as digits in parentheses, where many stand side by side.

    Examples
    --------
    >>> concise(Estimate(0.05145, 2e-5, "m"), Look(True, True, si=False))
    '51.450(20) mm'
    """
    if estimate is None:
        return "-"
    chosen = estimate if look.si else prefixed(estimate)
    written = in_brackets(format_value(chosen.value, chosen.u))
    if not look.unicode:
        return f"{written} {chosen.unit.replace('µ', 'u')}".rstrip()
    return f"{typeset(written)} {page_unit(chosen.unit)}".rstrip()
