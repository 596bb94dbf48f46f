"""``springmass compare``: do several runs agree on one spring, and does one damping law hold across them?"""

from __future__ import annotations

import json
import shlex
from collections.abc import Sequence
from pathlib import Path

from acquisition.errors import visible
from springmass.batch.rows import COURSE, is_course, read_rows
from springmass.errors import OK, REJECTED, USAGE, ProgramError, complain, suggest, tell
from springmass.options import CompareOptions
from springmass.runs.analysing import Analysed, analyse_loaded, distinct_names, law_line, make_folder, now_utc, scene_of
from springmass.runs.comparing import Compared, compare_analysed, comparison_json, demand_one_spring
from springmass.runs.json_results import SCHEMA, picked, plain, provenance_of, rejected
from springmass.runs.loading import load
from springmass.runs.options import ReadOptions
from springmass.runs.scenes import read_scenes

__all__ = ["run"]

READING = ("channel", "run", "rate_hz", "unit", "from_s", "to_s")


def run(recordings: Sequence[str | Path], options: CompareOptions, read: ReadOptions) -> int:
    """Analyse every run, compare them, and print or write the result; for courses use the existing results."""
    inputs = [str(each) for each in recordings]
    if all(is_course(path) for path in inputs):
        return _run_courses(inputs, options)
    if len(inputs) < 2:
        raise ProgramError(
            f"compare needs two runs at least, got {len(inputs)}; springmass analyse takes a single one", USAGE
        )
    names = distinct_names(inputs)
    # Scenes are read first, so that their errors are found before an hour of recordings is read.
    given = read_scenes(options.scene, len(inputs))
    out = None if options.output is None else make_folder(options.output)
    loaded = [load(path, read) for path in inputs]
    scenes = [scene_of(one, scene) for one, scene in zip(loaded, given, strict=True)]
    demand_one_spring(list(zip(names, scenes, strict=True)))
    time_utc = now_utc()
    parameters = {**picked(options, ("accuracy", "law", "mass_correlation", "strict")), **picked(read, READING)}
    runs = [
        analyse_loaded(one, scene, accuracy=options.accuracy, law=options.law).described(
            parameters, name=name, time_utc=time_utc
        )
        for name, one, scene in zip(names, loaded, scenes, strict=True)
    ]
    compared = compare_analysed(runs, mass_correlation=options.mass_correlation)
    result = comparison_json(compared, runs, provenance_of(options.accuracy, parameters, time_utc))
    if options.json:
        print(json.dumps(result, allow_nan=False), flush=True)
    else:
        every: list[str | Path | None] = [*options.scene] or [None]
        files = every if len(every) == len(loaded) else every * len(loaded)
        lines = [law_line(run.analysis, one.path, file) for run, one, file in zip(runs, loaded, files, strict=True)]
        for line in dict.fromkeys(line for line in lines if line):
            print(line)
        _print_text(compared, runs)
    if out is not None:
        from springmass.report.write import write_report

        page = write_report(out, runs, compared=compared, summary=result, figures=options.figures)
        tell(f"report: {page}")
        suggest(f"open {page} in a browser")
    else:
        suggest("the same command with -o DIR writes the report")
    findings = [*result["findings"], *(f for run in runs for f in run.result["findings"])]
    if options.strict and (wrong := rejected(findings)):
        complain(f"rejected under --strict: {', '.join(wrong)}")
        return REJECTED
    return OK


def _run_courses(inputs: Sequence[str], options: CompareOptions) -> int:
    from springmass.batch.benches import compare_rows, compared_text
    from springmass.terminal.printing import visible_lines

    if options.output is not None or options.scene:
        raise ProgramError("-o and --scene go with single runs; a course has its page and its scenes", USAGE)
    rows = [{**row, COURSE: visible(folder)} for folder in inputs for row in read_rows(folder)[0]]
    found = compare_rows(rows)
    print(
        json.dumps({"schema": SCHEMA, **plain(found)}, allow_nan=False)
        if options.json
        else visible_lines(compared_text(found))
    )
    wrong = {one.name for one in found.suspects}.union(*(one.names for one in found.disagreements))
    if options.strict and wrong:
        complain(f"rejected under --strict: {len(wrong)} runs differ from their course or bench")
        return REJECTED
    for suspect in found.suspects[:1]:
        path = next(row["path"] for row in rows if suspect.name in (row["run"], f"{row[COURSE]}: {row['run']}"))
        suggest(f"springmass analyse {shlex.quote(path)}")
    return OK


def _print_text(compared: Compared, runs: list[Analysed]) -> None:
    from springmass.terminal.printing import comparison_text, findings_text, wrapped

    print(comparison_text(compared.comparison, [run.analysis for run in runs]))
    for joint in compared.joint:
        print(f"\n{wrapped(joint.message)}")
    for run in runs:
        grave = [f for f in run.result["findings"] if f["severity"] != "info"]
        if grave:
            print(f"\n{visible(run.name)}:")
            print(findings_text(grave))
