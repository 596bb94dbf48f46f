"""``springmass formats``: the families of recordings, or what one file is."""

from __future__ import annotations

import argparse
import json
from typing import Any

import numpy as np

from acquisition.registry import formats
from springmass.commands import completions
from springmass.errors import OK
from springmass.loading import Loaded, load

__all__ = ["run"]

RUN_TITLE = "springmass run file (HDF5, opens in xarray, h5py and NeXus tools)"


def run(options: argparse.Namespace) -> int:
    """List the formats, or describe a file."""
    if options.input is None:
        return _list(options)
    loaded = load(options.input, **completions(options))
    facts = _facts(loaded)
    if options.json:
        print(json.dumps(facts, allow_nan=False))
        return OK
    for name, value in facts.items():
        if name != "traps":
            print(f"{name:<16} {_shown(value)}")
    for trap in facts["traps"]:
        where = f" (line {trap['line']})" if trap["line"] else ""
        print(f"{'trap':<16} {trap['code']}: {trap['message']}{where}")
    return OK


def _shown(value: object) -> str:
    if value is None:
        return "not stated"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _list(options: argparse.Namespace) -> int:
    table = {**{f.name: f.title for f in formats()}, "run": RUN_TITLE}
    if options.json:
        print(json.dumps([{"name": name, "title": title} for name, title in table.items()]))
        return OK
    for name, title in table.items():
        print(f"{name:<16} {title}")
    return OK


def _facts(loaded: Loaded) -> dict[str, Any]:
    t = loaded.samples.t
    finite = t[np.isfinite(t)]
    return {
        "path": str(loaded.path),
        "format": loaded.format,
        "title": loaded.title or None,
        "kind": loaded.info.kind,
        "channel": loaded.channel,
        "samples": len(loaded.samples),
        "missing": int(np.count_nonzero(~np.isfinite(loaded.samples.distance))),
        "malformed_rows": loaded.malformed_rows,
        "from_s": float(finite.min()) if finite.size else None,
        "to_s": float(finite.max()) if finite.size else None,
        "rate_hz": loaded.info.rate_hz,
        "clock": loaded.info.clock,
        "quantum_m": loaded.info.quantum_m,
        "stated_error_m": loaded.info.stated_error_m,
        "sha256": loaded.sha256,
        "traps": [{"code": x.code, "message": x.message, "count": x.count, "line": x.line} for x in loaded.traps],
    }
