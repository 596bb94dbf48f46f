"""``springmass compare``: do several runs agree on one spring, and does one damping law hold across them?"""

from __future__ import annotations

import json
import math
import shlex
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

from acquisition.errors import visible
from pipeline.findings.finding import kinds
from springmass.commands.given import GivenOptions
from springmass.commands.options import (
    AnalysisArguments,
    FiguresOption,
    FileArgument,
    Json,
    ReadPairs,
    Scenes,
    Strict,
    Template,
)
from springmass.commands.parameters import Share, argument, option, output
from springmass.comparing.comparison import SpringComparison, compare_runs, comparison_json, comparison_words
from springmass.course.results_csv import COURSE, is_course, read_results
from springmass.errors import HINT, LOG, OK, REJECTED, ProgramError
from springmass.loading.save import now_utc
from springmass.loading.scenes import read_scenes
from springmass.result.output_names import distinct_names, make_folder
from springmass.result.run_json import RESULT_SCHEMA, plain, provenance_of, rejected
from springmass.runs.run import Run
from springmass.runs.tasks import Task, analysed_runs, law_lines
from springmass.typeset import count

if TYPE_CHECKING:
    from springmass.course.benches import CourseComparison


def compare(
    *recordings: Annotated[
        FileArgument, argument("RUN", "two or more runs of one spring, or folders from batch", required=True)
    ],
    scene: Scenes = (),
    mass_correlation: Annotated[
        Share, option("R", "correlation between the errors of two bobs' masses (default: 0)")
    ] = 0.0,
    reported: Annotated[
        FileArgument | None, option("FILE", "table of printed values to judge: columns run, name, value, u, unit")
    ] = None,
    hooke: Annotated[
        FileArgument | None,
        option("FILE", "table of masses or forces and positions: k by Hooke's law beside that of the runs"),
    ] = None,
    output: Annotated[FileArgument | None, output("DIR", "folder for a report (default: write no report)")] = None,
    figures: FiguresOption = (),
    template: Template = None,
    as_json: Json = False,
    strict: Strict = False,
    reading: ReadPairs = ReadPairs(),
    analysis: AnalysisArguments = AnalysisArguments(),
    given: GivenOptions,
) -> int:
    """Analyse every run, compare them, and print or write the result; for courses use the existing results."""
    reading.refuse("on several runs", "velocity")
    how = analysis.of(reading.options)
    if all(is_course(path) for path in recordings):
        given.only("on courses, which are analysed already", "--json", "--strict")
        return _run_courses(recordings, as_json=as_json, strict=strict)
    if len(recordings) < 2:
        raise ProgramError(
            f"compare needs two runs at least, got {len(recordings)}", "springmass analyse takes a single one"
        )
    if output is None:
        given.refuse("without -o", "--figures", "--template")
    # Scenes are read first, so that their errors are found before an hour of recordings is read.
    scenes = read_scenes(scene, len(recordings))
    out = None if output is None else make_folder(output)
    each = zip(recordings, distinct_names(recordings), scenes, strict=True)
    runs = analysed_runs(Task(path, name, of_run, how) for path, name, of_run in each)
    compared = compare_runs(runs, mass_correlation=mass_correlation, reported=reported, static=hooke)
    parameters = {**how.parameters, "mass_correlation": mass_correlation}
    result = comparison_json(compared, provenance_of(how.accuracy, parameters, now_utc()))
    if as_json:
        print(json.dumps(result, allow_nan=False), flush=True)
    else:
        _print_text(compared, runs)
    if out is not None:
        from springmass.report.write import write_report
        from springmass.terminal.progress import counted_figures

        page = write_report(
            out,
            runs,
            compared=compared,
            summary=result,
            figures=figures,
            template=template,
            counting=counted_figures,
        )
        LOG.info(f"report: {page}")
        LOG.log(HINT, f"open {page} in a browser")
    else:
        LOG.log(HINT, "the same command with -o DIR writes the report")
    findings = [*result["findings"], *(f for run in runs for f in run.result["findings"])]
    if strict and (wrong := rejected(findings)):
        LOG.warning(f"rejected under --strict: {', '.join(wrong)}")
        return REJECTED
    return OK


def _run_courses(folders: Sequence[str], *, as_json: bool, strict: bool) -> int:
    from springmass.course.benches import compare_rows
    from springmass.terminal.printing import visible_lines

    rows = [{**row, COURSE: visible(folder)} for folder in folders for row in read_results(folder)[0]]
    compared = compare_rows(rows)
    print(
        json.dumps({"schema": RESULT_SCHEMA, **plain(compared)}, allow_nan=False)
        if as_json
        else visible_lines(_course_text(compared))
    )
    wrong = {group.name for group in compared.suspects}.union(*(group.names for group in compared.disagreements))
    if strict and wrong:
        LOG.warning(f"rejected under --strict: {len(wrong)} runs differ from their course or bench")
        return REJECTED
    for suspect in compared.suspects[:1]:
        path = next(row["path"] for row in rows if suspect.name in (row["run"], f"{row[COURSE]}: {row['run']}"))
        LOG.log(HINT, f"springmass analyse {shlex.quote(path)}")
    return OK


def _print_text(compared: SpringComparison, runs: list[Run]) -> None:
    from springmass.terminal.printing import comparison_text, findings_text, reported_text, wrapped
    from springmass.terminal.style import style_of

    text = comparison_text(compared.comparison, [run.analysis for run in runs], style_of(sys.stdout))
    print(*law_lines(runs), text, sep="\n")
    for message in (*comparison_words(compared), *(joint.message for joint in compared.joint)):
        print(f"\n{wrapped(message)}")
    if compared.reported:
        mistakes = [plain(f) for f in compared.findings if "reported" in kinds()[f.code].about]
        print(f"\n{reported_text(compared.reported, style_of(sys.stdout))}\n\n{findings_text(mistakes, full=True)}")
    for run in runs:
        grave = [f for f in run.result["findings"] if f["severity"] != "info"]
        if grave:
            print(f"\n{visible(run.name)}:")
            print(findings_text(grave))


def _course_text(comparison: CourseComparison) -> str:
    lines = [f"{comparison.runs} runs; benches distinguished by {comparison.bench}", ""]
    for group in comparison.agreements:
        of = f" of {group.group}" if group.group else ""
        if group.mean is None:
            lines.append(f"{group.quantity}{of}: no mean; {group.why}")
            continue
        lines.append(f"{group.quantity}{of}: {group.mean}")
        within = "one run a bench" if math.isnan(group.within) else f"{group.within:.2g} within a bench"
        benches = f"{group.between:.2g} between {group.benches} benches"
        between = "one bench" if math.isnan(group.between) else benches
        lines.append(f"  {count(group.runs, 'run')}; scatter {within} (stated {group.stated:.2g}), {between}")
    if any(group.quantity == "drag_coefficient" for group in comparison.agreements):
        lines.append("a drag coefficient counts all damping as drag of the disc, that of spring and hook too")
    laws = ", ".join(f"{law} {runs}" for law, runs in comparison.laws.items())
    lines += ["", f"damping laws selected: {laws}"] if laws else []
    differing = comparison.suspects
    lines += ["", f"runs that differ from their course: {len(differing)}"] if differing else []
    lines += [f"  {suspect.name}: {suspect.message}" for suspect in differing]
    apart = comparison.disagreements
    lines += ["", f"benches whose runs disagree: {len(apart)}"] if apart else []
    lines += [f"  {one.bench or ', '.join(one.names)}: {one.message}" for one in apart]
    return "\n".join(lines)
