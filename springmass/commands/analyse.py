"""``springmass analyse``: from recordings to Table 1, findings and a report.

Several inputs are analysed one after the other: twenty records of two minutes take 1.4 s, and a second process would
take longer to begin (``benchmarks/many.py``). Their samples are in memory together; ``springmass batch`` is for more.
"""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from springmass.commands.given import GivenOptions
from springmass.commands.options import (
    FURTHER_OPTIONS,
    AnalysisArguments,
    BenchOptions,
    ClockPpm,
    FiguresOption,
    FileArgument,
    Json,
    ReadArguments,
    Scenes,
    Strict,
    Template,
)
from springmass.commands.parameters import Finite, argument, flag, option, output
from springmass.commands.questions import for_one
from springmass.errors import HINT, LOG, OK, REJECTED, SOME_FAILED, UNREADABLE, USAGE, ProgramError, of_several
from springmass.layout import STDIN
from springmass.loading.inputs import files_of
from springmass.loading.notes import keep_answers
from springmass.loading.options import LoadOptions
from springmass.loading.scenes import read_scenes
from springmass.result.output_names import distinct_names, make_folder, results_name
from springmass.result.run_json import rejected
from springmass.runs.run import Run
from springmass.runs.tasks import Failed, Task, analyse_all, law_lines
from springmass.terminal.progress import counted, counted_figures
from storage.errors import WriteFailed

TOGETHER = "together.results"
LONGEST_INPUTS = 48  # maximum length of input names repeated in a suggested command


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class AnalyseOptions:
    """The options of ``springmass analyse``."""

    scene: Scenes = ()
    from_s: Annotated[Finite | None, option("S", "use samples from this time on, s", "--from")] = None
    to_s: Annotated[Finite | None, option("S", "use samples up to this time, s", "--to")] = None
    clock_ppm: ClockPpm = None
    method: Annotated[
        Literal["classic"] | None,
        option("NAME", "also apply the lab report's classic method, for comparison"),
        FURTHER_OPTIONS,
    ] = None
    output: Annotated[FileArgument | None, output("DIR", "output folder (default: here; with --json: none)")] = None
    keep: Annotated[bool, flag("keep the options of reading in the notes next to the file")] = False
    no_report: Annotated[bool, flag("print the results, but write no files")] = False
    full: Annotated[bool, flag("print all warnings and notes, and the sources of uncertainty")] = False
    template: Annotated[Template, FURTHER_OPTIONS] = None
    figures: Annotated[FiguresOption, FURTHER_OPTIONS] = ()
    si: Annotated[bool, flag("print SI units without prefixes"), FURTHER_OPTIONS] = False
    json: Json = False
    strict: Annotated[Strict, FURTHER_OPTIONS] = False


def analyse(
    *recordings: Annotated[
        FileArgument,
        argument("INPUT", "recordings, run files or folders of these; - for standard input", required=True),
    ],
    options: AnalyseOptions = AnalyseOptions(),
    read: ReadArguments = ReadArguments(),
    analysis: AnalysisArguments = AnalysisArguments(),
    bench: BenchOptions = BenchOptions(),
    given: GivenOptions,
) -> int:
    """Analyse every input; if one fails, the others still give results."""
    own = {name: getattr(options, name) for name in ("from_s", "to_s", "clock_ppm", "method")}
    how = analysis.of(read, **own)
    if options.keep and (not read.about_the_file().given() or STDIN in recordings):
        raise ProgramError("--keep keeps options of reading such as --unit next to a file", "give one, and the file")
    if how.velocity is not None and (len(recordings) > 1 or Path(recordings[0]).is_dir()):
        got = f"{len(recordings)} inputs" if len(recordings) > 1 else "a folder"
        raise ProgramError(f"--velocity completes one position file, got {got}", "analyse the pair by itself")
    scenes, values = read_scenes(options.scene, len(recordings)), bench.values()
    files, folders = files_of(recordings)
    for line in folders:
        LOG.info(line)
    alone = len(files) == 1
    names = [""] if alone else distinct_names(["stdin" if file.path == STDIN else file.path for file in files])
    of_files = [how if file.velocity is None else replace(how, velocity=file.velocity) for file in files]
    tasks = [
        Task(file.path, name, scenes[file.of], of_file, values)
        for file, name, of_file in zip(files, names, of_files, strict=True)
    ]
    out = Path(options.output or ".") if not options.no_report and (options.output or not options.json) else None
    if out is None:
        given.refuse("without a report", "--template", "--figures")
    if options.json:
        given.refuse("on JSON", "--full", "--si")
    if not alone:
        given.refuse("on several inputs", "--template", "--full")
    runs, codes = _analysed(tasks, options, typed=recordings == (files[0].path,))
    if runs and not options.json:
        _print_text(runs[0], options) if alone else _print_together(runs, options)
    written = OK
    if runs and out is not None:
        name = results_name(runs[0].loaded.path, run=how.run, channel=how.channel) if alone else TOGETHER
        written = _write(out / name, runs, options)
    _keep(runs, read, options)
    codes += [_judged(run, options) for run in runs]
    if len(runs) > 1:
        named = shlex.join(recordings)
        LOG.log(HINT, f"springmass compare {named if len(named) <= LONGEST_INPUTS else '...'}")
    code = of_several(codes)
    return code if code == SOME_FAILED else max(code, written)


def _analysed(tasks: Sequence[Task], options: AnalyseOptions, *, typed: bool) -> tuple[list[Run], list[int]]:
    """Return the runs, printed as JSON if that is wanted, and the exit codes of inputs that give none."""
    runs, codes = list[Run](), list[int]()
    for outcome in counted(analyse_all(tasks), len(tasks), "runs"):
        if isinstance(outcome, Run):
            runs.append(outcome)
            if options.json:
                print(json.dumps(outcome.result, allow_nan=False), flush=True)
        elif outcome.question is not None and typed:
            raise outcome.question  # the caller answers it with the typed command line
        else:
            codes.append(_failed(outcome))
    return runs, codes


def _keep(runs: Sequence[Run], read: LoadOptions, options: AnalyseOptions) -> None:
    """Keep what was stated about the files in the notes next to them, or say how to."""
    given = read.about_the_file().given()
    for run in runs if options.keep else ():
        path = keep_answers(run.loaded.path, given, run.loaded.sha256)
        LOG.info(f"{path}: {', '.join(given)} kept, used from now on with {run.loaded.path.name}")
    if runs and given.keys() - {"velocity"} and not options.keep:
        LOG.log(HINT, "the same command with --keep saves the options of reading next to the file")


def _failed(failed: Failed) -> int:
    """Say why a recording gives no run; the remedy of a question names the command for this recording alone."""
    task, asked = failed.task, failed.question
    LOG.warning(failed.error if asked is None else for_one(asked, "analyse", task.source, task.how.given()))
    return failed.error.exit_code


def _judged(run: Run, options: AnalyseOptions) -> int:
    """Return the exit code of an analysis, and say why it is not 0."""
    path = run.result["input"]["path"]
    if not run.ok:
        LOG.warning(f"{path}: no oscillation: {run.why}")
        return UNREADABLE
    if options.strict and (wrong := rejected(run.result["findings"])):
        LOG.warning(f"{path}: rejected under --strict: {', '.join(wrong)}")
        return REJECTED
    return OK


def _print_text(run: Run, options: AnalyseOptions) -> None:
    """Print Table 1, one sentence on damping and the warnings, and further parts on request."""
    from springmass.report.words import damping_sentence
    from springmass.result.budget_tables import budget_text
    from springmass.result.grades import grades_text
    from springmass.terminal.printing import classic_text, findings_text, fitted, text_table, wrapped
    from springmass.terminal.style import style_of
    from springmass.typeset import typeset

    style = style_of(sys.stdout, si=options.si)
    print(*law_lines([run]), text_table([run.name], [run.analysis], style), sep="\n")
    if run.classic is not None:
        print(f"{classic_text(run.classic)}\n")
    if options.full and (budget := budget_text(run.analysis)):
        print(f"{fitted(budget, style.width) if style.terminal else budget}\n")
    for text in (grades_text(run.analysis, page=style.unicode), damping_sentence(run.analysis)):
        if text:
            print(f"{wrapped(text, '', 80)}\n")
    print(findings_text(run.result["findings"], typeset if style.unicode else str, full=options.full))


def _print_together(runs: Sequence[Run], options: AnalyseOptions) -> None:
    from springmass.terminal.printing import shared_findings_text, text_table
    from springmass.terminal.style import style_of
    from springmass.typeset import typeset

    style = style_of(sys.stdout, si=options.si)
    table = text_table([run.name for run in runs], [run.analysis for run in runs], style)
    print(*law_lines(runs), table, sep="\n")
    findings = {run.name: run.result["findings"] for run in runs}
    print(shared_findings_text(findings, typeset if style.unicode else str))


def _write(folder: Path, runs: Sequence[Run], options: AnalyseOptions) -> int:
    """Write the report, and return an exit code: a folder that takes none costs one line, and not the result."""
    from springmass.report.write import write_report

    template = options.template if len(runs) == 1 else None
    try:
        make_folder(folder.parent)
        page = write_report(folder, runs, figures=options.figures, template=template, counting=counted_figures)
        LOG.info(f"report: {page}")
    except (ProgramError, WriteFailed) as error:
        LOG.warning(f"{error}; --no-report writes no files")
        return USAGE
    return OK
