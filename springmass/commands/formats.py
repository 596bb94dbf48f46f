"""``springmass formats``: the families of recordings, or what one file is."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.errors import NeedsAnswer, visible
from acquisition.recordings.identify import formats, inspect
from acquisition.recordings.inspection import Inspection, Survey
from springmass.commands import completions
from springmass.errors import OK
from springmass.runs.json_results import picked, plain
from springmass.runs.loading import Loaded, kind_of, load

__all__ = ["run"]

OURS = {
    "run": "springmass run file (HDF5, opens in xarray, h5py and NeXus tools)",
    "wire": "springmass wire log: what was on disk while a run was recorded",
}
_WHY = {"run": "it begins with the signature of HDF5", "wire": "it begins with the mark of a log's record"}


def run(options: argparse.Namespace) -> int:
    """List the formats, or describe a file."""
    if options.input is None:
        return _list(options)
    facts = _describe(Path(options.input), completions(options))
    if options.json:
        print(json.dumps(facts, allow_nan=False))
        return OK
    for line in _lines(facts):
        print(visible(line))
    return OK


def _list(options: argparse.Namespace) -> int:
    table = {**{f.name: f.title for f in formats()}, **OURS}
    if options.json:
        print(json.dumps([{"name": name, "title": title} for name, title in table.items()]))
        return OK
    for name, title in table.items():
        print(f"{name:<16} {title}")
    return OK


def _describe(path: Path, answers: dict[str, Any]) -> dict[str, Any]:
    """Say what a file is; where one channel can be taken as distance, also what its samples are."""
    kind = kind_of(path)
    if kind != "recording":
        loaded = load(path, **answers)
        samples = loaded.samples
        survey = Survey("", loaded.channel, samples.unit, len(samples), loaded.info.rate_hz, loaded.traps)
        return {**_file(path, Inspection(kind, OURS[kind], _WHY[kind], (survey,))), **_facts(loaded)}
    found = inspect(path)
    facts = _file(path, found)
    try:
        return {**facts, **_facts(load(path, **answers))}
    except NeedsAnswer as error:
        traps = list(dict.fromkeys(trap for survey in found.surveys for trap in survey.traps))
        return {**facts, "needs": str(error).removeprefix(f"{path}: "), "traps": plain(traps)}


def _file(path: Path, found: Inspection) -> dict[str, Any]:
    return {
        "path": str(path),
        "format": found.format,
        "family": found.title,
        "why": found.why or None,
        "channels": [
            {
                "run": each.run or None,
                "name": each.channel,
                "unit": each.unit or None,
                "samples": each.samples,
                "rate_hz": each.rate_hz,
                "traps": [trap.code for trap in each.traps],
            }
            for each in found.surveys
        ],
    }


def _facts(loaded: Loaded) -> dict[str, Any]:
    t = loaded.samples.t
    finite = t[np.isfinite(t)]
    return {
        "title": loaded.title or None,
        "start_time": loaded.provenance.get("start_time"),
        "kind": loaded.info.kind,
        "channel": loaded.channel,
        "quantity": f"{loaded.samples.quantity} in {loaded.samples.unit}",
        "samples": len(loaded.samples),
        "missing": int(np.count_nonzero(~np.isfinite(loaded.samples.distance))),
        "malformed_rows": loaded.malformed_rows,
        "from_s": float(finite.min()) if finite.size else None,
        "to_s": float(finite.max()) if finite.size else None,
        **picked(loaded.info, ("rate_hz", "clock", "quantum_m", "stated_error_m")),
        "sha256": loaded.sha256,
        "traps": plain(loaded.traps),
    }


def _lines(facts: dict[str, Any]) -> Iterator[str]:
    for name, value in facts.items():
        if name == "channels":
            for each in value:
                yield f"{'holds':<16} {_channel(each)}"
        elif name == "traps":
            for trap in value:
                where = f" (line {trap['line']})" if trap["line"] else ""
                yield f"{'trap':<16} {trap['code']}: {trap['message']}{where}"
        else:
            yield f"{name:<16} {_shown(value)}"


def _channel(each: dict[str, Any]) -> str:
    run_of = f"{each['run']}: " if each["run"] else ""
    unit = f" ({each['unit']})" if each["unit"] else ", no unit stated"
    rate = f"{each['rate_hz']:.6g} Hz" if each["rate_hz"] else "rate not stated"
    traps = f"; {', '.join(dict.fromkeys(each['traps']))}" if each["traps"] else ""
    return f"{run_of}{each['name']}{unit}, {each['samples']} samples, {rate}{traps}"


def _shown(value: object) -> str:
    if value is None:
        return "not stated"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
