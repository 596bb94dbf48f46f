"""``springmass compare``: do several runs agree on one spring, and does one damping law hold across them?"""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from acquisition.errors import visible
from springmass.commands.options import (
    Figures,
    File,
    Json,
    Scenes,
    Strict,
    argument,
    option,
    output,
    refuse,
)
from springmass.course.rows import COURSE, is_course, read_rows
from springmass.errors import OK, REJECTED, USAGE, ProgramError, complain, suggest, tell
from springmass.runs.analysing import law_line
from springmass.runs.comparing import Compared, compare_runs, comparison_json
from springmass.runs.json_results import SCHEMA, plain, provenance_of, rejected
from springmass.runs.options import How
from springmass.runs.outputs import distinct_names, make_folder, now_utc
from springmass.runs.run import Run
from springmass.runs.scenes import read_scenes
from springmass.values import Share


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class CompareOptions:
    """The options of ``springmass compare``."""

    scene: Scenes = ()
    mass_correlation: Annotated[
        Share, option("R", "correlation between the errors of two bobs' masses (default: 0)")
    ] = 0.0
    output: Annotated[File | None, output("DIR", "folder for a report (default: write no report)")] = None
    figures: Figures = ()
    json: Json = False
    strict: Strict = False


def compare(
    *recordings: Annotated[
        File, argument("RUN", "two or more runs of one spring, or folders from batch", required=True)
    ],
    options: CompareOptions = CompareOptions(),
    how: How = How(),
) -> int:
    """Analyse every run, compare them, and print or write the result; for courses use the existing results."""
    refuse("compare", how, "velocity")
    inputs = [str(each) for each in recordings]
    if all(is_course(path) for path in inputs):
        return _run_courses(inputs, options)
    if len(inputs) < 2:
        raise ProgramError(
            f"compare needs two runs at least, got {len(inputs)}; springmass analyse takes a single one", USAGE
        )
    # Scenes are read first, so that their errors are found before an hour of recordings is read.
    scenes = read_scenes(options.scene, len(inputs))
    out = None if options.output is None else make_folder(options.output)
    runs = [
        Run.of(path, scene, how, name) for path, scene, name in zip(inputs, scenes, distinct_names(inputs), strict=True)
    ]
    compared = compare_runs(runs, mass_correlation=options.mass_correlation)
    parameters = {**how.parameters, "mass_correlation": options.mass_correlation}
    result = comparison_json(compared, provenance_of(how.accuracy, parameters, now_utc()))
    if options.json:
        print(json.dumps(result, allow_nan=False), flush=True)
    else:
        every: list[str | Path | None] = [*options.scene] or [None]
        files = every if len(every) == len(runs) else every * len(runs)
        lines = [law_line(run, file) for run, file in zip(runs, files, strict=True)]
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
    from springmass.course.benches import compare_rows, compared_text
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


def _print_text(compared: Compared, runs: list[Run]) -> None:
    from springmass.terminal.printing import comparison_text, findings_text, wrapped
    from springmass.terminal.style import style_of

    print(comparison_text(compared.comparison, [run.analysis for run in runs], style_of(sys.stdout)))
    for joint in compared.joint:
        print(f"\n{wrapped(joint.message)}")
    for run in runs:
        grave = [f for f in run.result["findings"] if f["severity"] != "info"]
        if grave:
            print(f"\n{visible(run.name)}:")
            print(findings_text(grave))
