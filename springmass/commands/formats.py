"""``springmass formats``: the families of recordings, or what one file is."""

import json
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from acquisition.errors import NeedsAnswer, visible
from acquisition.recordings.identify import Inspection, inspect
from acquisition.recordings.identify import formats as every_format
from acquisition.recordings.recording import Survey
from springmass.commands.given import GivenOptions
from springmass.commands.options import FileArgument, Json, ReadArguments
from springmass.commands.parameters import argument
from springmass.commands.questions import for_command, option_words
from springmass.errors import HINT, LOG, OK
from springmass.loading.inputs import kind_of
from springmass.loading.load import load
from springmass.loading.loaded import Loaded
from springmass.loading.options import LoadOptions
from springmass.result.run_json import picked, plain

OURS = {
    "run": "springmass run file (HDF5, opens in xarray, h5py and NeXus tools)",
    "wire": "springmass wire log: what was on disk while a run was recorded",
}
WHY = {"run": "it begins with the signature of HDF5", "wire": "it begins with the mark of a log's record"}


def formats(
    file: Annotated[FileArgument | None, argument("FILE", "identify this file")] = None,
    /,
    *,
    as_json: Json = False,
    read: ReadArguments = ReadArguments(),
    given: GivenOptions,
) -> int:
    """List the formats, or describe a file."""
    if file is None:
        given.only("without a file", "--json")
        table = {**{f.name: f.title for f in every_format()}, **OURS}
        lines = [f"{name:<16} {title}" for name, title in table.items()]
        titles = [{"name": name, "title": title} for name, title in table.items()]
        print(json.dumps(titles) if as_json else "\n".join(lines))
        return OK
    path = Path(file)
    facts = _describe(path, read, as_json=as_json)
    if as_json:
        print(json.dumps(facts, allow_nan=False))
        return OK
    for line in _lines(facts):
        print(visible(line))
    if "needs" not in facts:
        LOG.log(HINT, f"springmass analyse {shlex.quote(file)}")
    return OK


def _describe(path: Path, read: LoadOptions, *, as_json: bool) -> dict[str, Any]:
    """Identify a file; if one channel can be used as distance, also describe its samples."""
    kind = kind_of(path)
    if kind != "recording":
        loaded = load(path, read)
        samples = loaded.samples
        survey = Survey("", loaded.channel, samples.unit, len(samples), loaded.info.rate_hz, loaded.traps)
        return {**_file(path, Inspection(kind, OURS[kind], WHY[kind], (survey,))), **_facts(loaded)}
    inspection = inspect(path, read.about_the_file())
    facts = _file(path, inspection)
    try:
        return {**facts, **_facts(load(path, read))}
    except NeedsAnswer as error:
        traps = list(dict.fromkeys(trap for survey in inspection.surveys for trap in survey.traps))
        words = ["springmass", "formats", str(path), *(["--json"] if as_json else []), *option_words(read.given())]
        answered = error.with_remedy(for_command(error.question, words))
        question = [plain(need) for need in error.question.needs]
        needs = visible(f"{answered.problem} {answered.remedy}")
        return {**facts, "needs": needs, "question": question, "traps": plain(traps)}


def _file(path: Path, inspection: Inspection) -> dict[str, Any]:
    channels = [
        {"run": each.run or None, "name": each.channel, "unit": each.unit or None}
        | picked(each, ("samples", "rate_hz"))
        | {"traps": [trap.code for trap in each.traps]}
        for each in inspection.surveys
    ]
    why = inspection.why or None
    return {
        "path": str(path),
        "format": inspection.format,
        "family": inspection.title,
        "why": why,
        "channels": channels,
    }


def _facts(loaded: Loaded) -> dict[str, Any]:
    t = loaded.samples.t
    finite = t[np.isfinite(t)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (None, None)
    return {
        "title": loaded.title or None,
        "start_time": loaded.provenance.get("start_time"),
        "kind": loaded.info.kind,
        "channel": loaded.channel,
        "quantity": f"{loaded.samples.quantity} in {loaded.samples.unit}",
        "samples": len(loaded.samples),
        "missing": int(np.count_nonzero(~np.isfinite(loaded.samples.distance))),
        "malformed_rows": loaded.recording.malformed_rows,
        "from_s": low,
        "to_s": high,
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
