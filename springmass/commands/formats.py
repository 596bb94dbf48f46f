"""``springmass formats``: the families of recordings, what one file is, or what a folder or a zip holds."""

from __future__ import annotations

import json
import shlex
import tempfile
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Annotated, Any

import numpy as np

from acquisition.errors import AcquisitionError, FormatError, NeedsAnswer, UnknownFormat, visible
from acquisition.recordings.families.archive import members
from acquisition.recordings.identify import Inspection, inspect, read_bytes, sniff
from acquisition.recordings.identify import formats as every_format
from acquisition.recordings.questions import Missing
from acquisition.recordings.recording import Survey
from springmass.commands.options import PART, File, Json, argument, refuse
from springmass.errors import OK, ProgramError, suggest
from springmass.runs.json_results import picked, plain
from springmass.runs.loading import Loaded, kind_of, load
from springmass.runs.options import ReadOptions
from springmass.runs.questions import for_command
from storage.errors import StorageError

OURS = {
    "run": "springmass run file (HDF5, opens in xarray, h5py and NeXus tools)",
    "wire": "springmass wire log: what was on disk while a run was recorded",
}
WHY = {"run": "it begins with the signature of HDF5", "wire": "it begins with the mark of a log's record"}
WIDEST = 44  # characters of a cell in the table of a folder, but of the last


def formats(
    file: Annotated[File | None, argument("FILE", "identify this file, or every file in this folder or zip")] = None,
    /,
    *,
    as_json: Json = False,
    read: ReadOptions = ReadOptions(),
) -> int:
    """List the formats, or describe a file, or every file of a folder or a zip."""
    refuse("formats", read, *PART)
    if file is None:
        table = {**{f.name: f.title for f in every_format()}, **OURS}
        lines = [f"{name:<16} {title}" for name, title in table.items()]
        titles = [{"name": name, "title": title} for name, title in table.items()]
        print(json.dumps(titles) if as_json else "\n".join(lines))
        return OK
    path = Path(file)
    if path.is_dir() or _is_zip(path):
        _print_all(list(_entries(path)), as_json=as_json)
        return OK
    facts = _describe(path, read, as_json=as_json)
    if as_json:
        print(json.dumps(facts, allow_nan=False))
        return OK
    for line in _lines(facts):
        print(visible(line))
    if "needs" not in facts:
        suggest(f"springmass analyse {shlex.quote(str(file))}")
    return OK


def _is_zip(path: Path) -> bool:
    try:
        return sniff(path) == "zip"
    except FormatError:
        return False


def _entries(path: Path) -> Iterator[dict[str, Any]]:
    """Yield what is known of each file of a zip, or of a folder and its subfolders except hidden files."""
    if path.is_dir():
        for file in sorted(each for each in path.rglob("*") if each.is_file()):
            inner = file.relative_to(path)
            if not any(part.startswith(".") for part in inner.parts):
                yield _entry(file, str(inner))
        return
    with tempfile.TemporaryDirectory(prefix="springmass-") as folder:
        for number, (name, data) in enumerate(members(str(path), read_bytes(path))):
            file = Path(folder) / f"{number}" / (PurePosixPath(name).name or "file")
            file.parent.mkdir()
            file.write_bytes(data)
            yield _entry(file, name)


def _entry(path: Path, name: str) -> dict[str, Any]:
    """Return family, channels, rate, span, the options that are missing, or why the file cannot be read."""
    facts: dict[str, Any] = {"file": name, "family": "", "channels": (), "rate_hz": None, "span_s": None}
    facts |= {"missing": (), "error": "", "recognised": True}
    try:
        loaded = load(path)
    except NeedsAnswer as unanswered:
        asked, found = unanswered.question.missing, inspect(path)
        surveys = [each for each in found.surveys if each.samples]
        timed = bool(surveys) and not {Missing.RATE_HZ, Missing.TIME_UNIT} & {*asked}
        channels = tuple(dict.fromkeys(each.channel for each in surveys))
        facts |= {"family": found.format, "channels": channels}
        facts |= {"missing": tuple(each.value.replace("_", "-") for each in asked)}
        return facts | (picked(surveys[0], ("rate_hz", "span_s")) if timed else {})
    except (AcquisitionError, StorageError, ProgramError) as error:
        text = str(error).removeprefix(str(path)).lstrip(":, ")
        return facts | {"error": text, "recognised": not isinstance(error, UnknownFormat)}
    t = loaded.samples.t[np.isfinite(loaded.samples.t)]
    facts |= {"family": loaded.format, "channels": (loaded.channel,), "rate_hz": loaded.info.rate_hz}
    return facts | {"span_s": float(t.max() - t.min()) if t.size else None}


def _print_all(entries: list[dict[str, Any]], *, as_json: bool) -> None:
    """Print one table of files."""
    if as_json:
        for each in entries:
            print(json.dumps(each, allow_nan=False))
        return
    rows = [["file", "family", "channels", "rate", "span", "missing"]]
    for each in entries:
        rate, span = each["rate_hz"], each["span_s"]
        why = each["error"] if each["recognised"] else "no format recognises it"
        cells = [each["file"], each["family"] or "none", ", ".join(each["channels"])]
        cells += ["" if rate is None else f"{rate:.4g} Hz", "" if span is None else f"{span:.4g} s"]
        rows.append([*cells, why or ", ".join(f"--{option}" for option in each["missing"])])
    most = (WIDEST, WIDEST, WIDEST, WIDEST, WIDEST, 100)
    rows = [[_fitted(visible(cell), width) for cell, width in zip(row, most, strict=True)] for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())


def _fitted(cell: str, width: int) -> str:
    return cell if len(cell) <= width else f"{cell[: width - 3]}..."


def _describe(path: Path, read: ReadOptions, *, as_json: bool) -> dict[str, Any]:
    """Identify a file; if one channel can be used as distance, also describe its samples."""
    kind = kind_of(path)
    if kind != "recording":
        loaded = load(path, read)
        samples = loaded.samples
        survey = Survey("", loaded.channel, samples.unit, len(samples), loaded.info.rate_hz, loaded.traps)
        return {**_file(path, Inspection(kind, OURS[kind], WHY[kind], (survey,))), **_facts(loaded)}
    found = inspect(path, delimiter=read.delimiter, decimal=read.decimal)
    facts = _file(path, found)
    try:
        return {**facts, **_facts(load(path, read))}
    except NeedsAnswer as error:
        traps = list(dict.fromkeys(trap for survey in found.surveys for trap in survey.traps))
        words = ["springmass", "formats", str(path), *(["--json"] if as_json else [])]
        answered = error.with_remedy(for_command(error.question, words, read.given()))
        question = [plain(need) for need in error.question.needs]
        needs = visible(f"{answered.problem} {answered.remedy}")
        return {**facts, "needs": needs, "question": question, "traps": plain(traps)}


def _file(path: Path, found: Inspection) -> dict[str, Any]:
    channels = [
        {"run": each.run or None, "name": each.channel, "unit": each.unit or None}
        | picked(each, ("samples", "rate_hz"))
        | {"traps": [trap.code for trap in each.traps]}
        for each in found.surveys
    ]
    why = found.why or None
    return {"path": str(path), "format": found.format, "family": found.title, "why": why, "channels": channels}


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
                run_of = f"{each['run']}: " if each["run"] else ""
                unit = f" ({each['unit']})" if each["unit"] else ", no unit stated"
                rate = f"{each['rate_hz']:.6g} Hz" if each["rate_hz"] else "rate not stated"
                traps = f"; {', '.join(dict.fromkeys(each['traps']))}" if each["traps"] else ""
                yield f"{'holds':<16} {run_of}{each['name']}{unit}, {each['samples']} samples, {rate}{traps}"
        elif name == "traps":
            for trap in value:
                where = f" (line {trap['line']})" if trap["line"] else ""
                yield f"{'trap':<16} {trap['code']}: {trap['message']}{where}"
        elif name != "question":  # the question repeats "needs" as data
            shown = "not stated" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
            yield f"{name:<16} {shown}"
