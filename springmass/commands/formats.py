"""``springmass formats``: the families of recordings, what one file is, or what a folder holds."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from acquisition.errors import NeedsAnswer, visible
from acquisition.recordings.base import Survey
from acquisition.recordings.identify import Inspection, inspect
from acquisition.recordings.identify import formats as every_format
from springmass.commands.options import PART, File, Json, argument, refuse
from springmass.errors import OK, suggest
from springmass.runs.json_results import picked, plain
from springmass.runs.loading import Loaded, kind_of, load
from springmass.runs.options import ReadOptions
from springmass.runs.questions import for_command
from springmass.runs.shelf import Entry, is_shelf, shelf

OURS = {
    "run": "springmass run file (HDF5, opens in xarray, h5py and NeXus tools)",
    "wire": "springmass wire log: what was on disk while a run was recorded",
}
_WIDTHS = (44, 13, 36, 11, 11, 100)
_WHY = {"run": "it begins with the signature of HDF5", "wire": "it begins with the mark of a log's record"}


def formats(
    file: Annotated[File | None, argument("FILE", "identify this file, or every file in this folder or zip")] = None,
    /,
    *,
    as_json: Json = False,
    read: ReadOptions = ReadOptions(),
) -> int:
    """List the formats, or describe a file."""
    refuse("formats", read, *PART)
    if file is None:
        return _list(as_json=as_json)
    path = Path(file)
    if is_shelf(path):
        return _shelf(path, as_json=as_json)
    facts = _describe(path, read, as_json=as_json)
    if as_json:
        print(json.dumps(facts, allow_nan=False))
        return OK
    for line in _lines(facts):
        print(visible(line))
    if "needs" not in facts:
        suggest(f"springmass analyse {shlex.quote(str(file))}")
    return OK


def _shelf(path: Path, *, as_json: bool) -> int:
    """Print one table of all files in a folder or a zip."""
    entries = shelf(path)
    if as_json:
        for each in entries:
            print(json.dumps(asdict(each), allow_nan=False))
        return OK
    rows = [("file", "family", "channels", "rate", "span", "missing"), *map(_row, entries)]
    widths = [min(max(map(len, column)), most) for column, most in zip(zip(*rows, strict=True), _WIDTHS, strict=True)]
    for row in rows:
        cells = (_fitted(visible(cell), width).ljust(width) for cell, width in zip(row, widths, strict=True))
        print("  ".join(cells).rstrip())
    return OK


def _row(each: Entry) -> tuple[str, ...]:
    rate = "" if each.rate_hz is None else f"{each.rate_hz:.4g} Hz"
    span = "" if each.span_s is None else f"{each.span_s:.4g} s"
    why = each.error if each.recognised else "no format recognises it"
    missing = why or ", ".join(f"--{option}" for option in each.missing)
    return each.file, each.family or "none", ", ".join(each.channels), rate, span, missing


def _fitted(cell: str, width: int) -> str:
    return cell if len(cell) <= width else f"{cell[: width - 3]}..."


def _list(*, as_json: bool) -> int:
    table = {**{f.name: f.title for f in every_format()}, **OURS}
    if as_json:
        print(json.dumps([{"name": name, "title": title} for name, title in table.items()]))
        return OK
    for name, title in table.items():
        print(f"{name:<16} {title}")
    return OK


def _describe(path: Path, read: ReadOptions, *, as_json: bool) -> dict[str, Any]:
    """Identify a file; if one channel can be used as distance, also describe its samples."""
    kind = kind_of(path)
    if kind != "recording":
        loaded = load(path, read)
        samples = loaded.samples
        survey = Survey("", loaded.channel, samples.unit, len(samples), loaded.info.rate_hz, loaded.traps)
        return {**_file(path, Inspection(kind, OURS[kind], _WHY[kind], (survey,))), **_facts(loaded)}
    found = inspect(path, delimiter=read.delimiter, decimal=read.decimal)
    facts = _file(path, found)
    try:
        return {**facts, **_facts(load(path, read))}
    except NeedsAnswer as error:
        traps = list(dict.fromkeys(trap for survey in found.surveys for trap in survey.traps))
        words = ["springmass", "formats", str(path), *(["--json"] if as_json else [])]
        answered = error.with_remedy(for_command(error.question, words, read.given()))
        question = [plain(need) for need in error.question.needs]
        return {
            **facts,
            "needs": visible(f"{answered.problem} {answered.remedy}"),
            "question": question,
            "traps": plain(traps),
        }


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
        elif name != "question":  # the question repeats "needs" as data
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
