"""``springmass analyse``: from recordings to Table 1, findings and a report.

Several inputs are analysed one after the other: twenty records of two minutes take 1.4 s, and a second process would
take longer to begin (``benchmarks/many.py``).
"""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from pipeline.numerics.estimate import Estimate
from springmass.commands.options import (
    FURTHER,
    BenchOptions,
    Figures,
    File,
    Json,
    Scenes,
    Strict,
    argument,
    flag,
    option,
    output,
)
from springmass.errors import (
    OK,
    REJECTED,
    SOME_FAILED,
    UNREADABLE,
    USAGE,
    ProgramError,
    complain,
    manner,
    suggest,
    tell,
)
from springmass.layout import STDIN
from springmass.runs.about import remember_scene
from springmass.runs.analysing import Failed, Task, analyse_all, law_line
from springmass.runs.inputs import files_of
from springmass.runs.json_results import rejected
from springmass.runs.options import How
from springmass.runs.outputs import distinct_names, make_folder, results_name
from springmass.runs.questions import for_command
from springmass.runs.run import Run
from springmass.runs.scenes import read_scenes
from storage.errors import WriteFailed

if TYPE_CHECKING:
    from springmass.runs.rows import TableKey

TOGETHER = "together.results"
MOST_TOGETHER = 20  # inputs in one report: their samples are in memory together; batch is for more
LONGEST_INPUTS = 48  # maximum length of input names repeated in a suggested command


@dataclass(frozen=True, slots=True)
class _Done:
    """What is printed at the end of one of several runs."""

    name: str
    result: Mapping[str, Any] = field(default_factory=dict)
    table: Mapping[TableKey, Estimate] = field(default_factory=dict)
    numbers: Mapping[str, Estimate] = field(default_factory=dict)
    law: str = ""


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class AnalyseOptions:
    """The options of ``springmass analyse``."""

    scene: Scenes = ()
    save_scene: Annotated[bool, flag("note the stated scene next to the recording, for later commands"), FURTHER] = (
        False
    )
    method: Annotated[
        Literal["classic"] | None,
        option("NAME", "also apply the lab report's classic method, for comparison"),
        FURTHER,
    ] = None
    output: Annotated[File | None, output("DIR", "output folder (default: here; with --json: none)")] = None
    no_report: Annotated[bool, flag("print the results, but write no files")] = False
    full: Annotated[bool, flag("print all warnings and notes, and the sources of uncertainty")] = False
    template: Annotated[Literal["latex"] | None, option("KIND", "also write a lab report template: latex"), FURTHER] = (
        None
    )
    figures: Annotated[Figures, FURTHER] = ()
    si: Annotated[bool, flag("print SI units without prefixes"), FURTHER] = False
    json: Json = False
    strict: Annotated[Strict, FURTHER] = False


def analyse(
    *recordings: Annotated[
        File, argument("INPUT", "recordings, run files or folders of these; - for standard input", required=True)
    ],
    options: AnalyseOptions = AnalyseOptions(),
    how: How = How(),
    bench: BenchOptions = BenchOptions(),
) -> int:
    """Analyse every input; if one fails, the others still give results."""
    inputs = [str(each) for each in recordings]
    if how.velocity is not None and (len(inputs) > 1 or Path(inputs[0]).is_dir()):
        got = f"{len(inputs)} inputs" if len(inputs) > 1 else "a folder"
        raise ProgramError(f"--velocity completes one position file, got {got}; analyse the pair by itself", USAGE)
    scenes, values = read_scenes(options.scene, len(inputs)), bench.values()
    found, folders = files_of(inputs)
    for line in folders:
        tell(line)
    alone = len(found) == 1
    names = [""] if alone else distinct_names(["stdin" if one.path == STDIN else one.path for one in found])
    how = replace(how, method=options.method)
    tasks = [
        Task(
            one.path, name, scenes[one.of], how if one.velocity is None else replace(how, velocity=one.velocity), values
        )
        for one, name in zip(found, names, strict=True)
    ]
    out = Path(options.output or ".") if not options.no_report and (options.output or not options.json) else None
    files = [options.scene[one.of if len(options.scene) > 1 else 0] if options.scene else None for one in found]
    if not alone:
        return _several(tasks, files, inputs, options, out)
    (run,) = analyse_all(tasks)
    if isinstance(run, Failed):
        if run.question is not None and inputs == [found[0].path]:
            raise run.question  # the caller answers it with the typed command line
        return _failed(run)
    if options.json:
        print(json.dumps(run.result, allow_nan=False), flush=True)
    else:
        if line := law_line(run, files[0]):
            print(line)
        _print_text(run, options)
    if options.save_scene:
        _save_scene(run)
    written = OK if out is None else _write(out / results_name(run), [run], options)
    return max(_judged(run, options), written)


def _several(
    tasks: Sequence[Task],
    files: Sequence[File | None],
    inputs: Sequence[str],
    options: AnalyseOptions,
    out: Path | None,
) -> int:
    """Analyse many inputs: one Table 1, one file of numbers and, if they are few, one report."""
    from springmass.runs.rows import every_number, table_estimates
    from springmass.terminal.progress import counted

    done: list[_Done] = []
    runs: list[Run] = []
    codes: list[int] = []
    analysed = counted(analyse_all(tasks), len(tasks), "runs", quiet=manner()[0])
    for run, file in zip(analysed, files, strict=True):
        if isinstance(run, Failed):
            codes.append(_failed(run))
            continue
        if options.json:
            print(json.dumps(run.result, allow_nan=False), flush=True)
        if options.save_scene:
            _save_scene(run)
        codes.append(_judged(run, options))
        table, numbers = table_estimates(run.analysis), every_number(run.analysis)
        done.append(_Done(run.name, run.result, table, numbers, law_line(run, file)))
        if len(tasks) <= MOST_TOGETHER:
            runs.append(run)
    if done and not options.json:
        _print_together(done, options)
    written = OK
    if runs and out is not None:
        written = _write(out / TOGETHER, runs, options)
    elif done and out is not None:
        written = _written(lambda: f"written: {_write_numbers(out / TOGETHER, done)}", out)
    if len(done) > 1:
        named = shlex.join(inputs)
        suggest(f"springmass compare {named if len(named) <= LONGEST_INPUTS else '...'}")
    if len(set(codes)) > 1 and any(code not in (OK, REJECTED) for code in codes):
        return SOME_FAILED
    return max(*codes, written)


def _failed(failed: Failed) -> int:
    """Say why a recording gives no run; the remedy of a question names the command for this recording alone."""
    task, message = failed.task, failed.message
    if failed.question is not None:
        path = f"./{task.path}" if task.path.startswith("-") else task.path
        velocity = () if task.how.velocity is None else ("--velocity", str(task.how.velocity))
        given = {name: value for name, value in task.how.given().items() if name != "velocity"}
        words = ["springmass", "analyse", path, *velocity]
        message = str(failed.question.with_remedy(for_command(failed.question.question, words, given)))
    complain(message)
    return failed.code


def _judged(run: Run, options: AnalyseOptions) -> int:
    """Return the exit code of an analysis, and say why it is not 0."""
    path = run.result["input"]["path"]
    if not run.ok:
        complain(f"{path}: no oscillation: {run.why}")
        return UNREADABLE
    if options.strict and (wrong := rejected(run.result["findings"])):
        complain(f"{path}: rejected under --strict: {', '.join(wrong)}")
        return REJECTED
    return OK


def _save_scene(run: Run) -> None:
    """Note the scene next to the recording; if that is impossible, print a message and continue."""
    if run.loaded.path == Path(STDIN):
        tell("--save-scene notes a scene next to a file; standard input has none, save the recording first")
        return
    try:
        if noted := remember_scene(run.loaded.path, run.loaded.scene, run.scene):
            tell(f"scene saved for this recording: {noted}")
    except WriteFailed as error:
        complain(error)


def _print_text(run: Run, options: AnalyseOptions) -> None:
    """Print Table 1, one sentence on damping and the warnings, and further parts on request."""
    from springmass.report.advice import trust_text
    from springmass.report.budgets import budget_text
    from springmass.report.words import damping_sentence
    from springmass.terminal.printing import classic_text, findings_text, fitted, wrapped
    from springmass.terminal.style import style_of
    from springmass.terminal.table1 import text_table
    from springmass.typeset import typeset

    style = style_of(sys.stdout, si=options.si)
    print(text_table([run.name], [run.analysis], style))
    if run.classic is not None:
        print(f"{classic_text(run.classic)}\n")
    if options.full and (budget := budget_text(run.analysis)):
        print(f"{fitted(budget, style.width) if style.terminal else budget}\n")
    for text in (trust_text(run.analysis, page=style.unicode), damping_sentence(run.analysis)):
        if text:
            print(f"{wrapped(text, '', 80)}\n")
    print(findings_text(run.result["findings"], typeset if style.unicode else str, full=options.full))


def _print_together(done: Sequence[_Done], options: AnalyseOptions) -> None:
    from springmass.terminal.printing import shared_findings_text
    from springmass.terminal.style import style_of
    from springmass.terminal.table1 import text_table
    from springmass.typeset import typeset

    for line in dict.fromkeys(one.law for one in done if one.law):
        print(line)
    style = style_of(sys.stdout, si=options.si)
    print(text_table([one.name for one in done], [one.table for one in done], style))
    findings = {one.name: one.result["findings"] for one in done}
    print(shared_findings_text(findings, typeset if style.unicode else str))


def _write(folder: Path, runs: Sequence[Run], options: AnalyseOptions) -> int:
    from springmass.report.write import write_report

    template = options.template if len(runs) == 1 else None
    return _written(
        lambda: f"report: {write_report(folder, runs, figures=options.figures, template=template)}", folder.parent
    )


def _written(write: Callable[[], str], folder: Path) -> int:
    """Write files, and return an exit code: a folder that takes none costs one line, and not the result."""
    try:
        make_folder(folder)
        tell(write())
    except (ProgramError, WriteFailed) as error:
        complain(f"{error}; --no-report writes no files")
        return USAGE
    return OK


def _write_numbers(folder: Path, done: Sequence[_Done]) -> Path:
    """Write the numbers of all runs: results.csv for a table, results.json for programs."""
    from springmass.runs.rows import results_csv
    from storage.atomic import write_whole
    from storage.folder import whole_folder

    text = json.dumps([one.result for one in done], indent=2, allow_nan=False, ensure_ascii=False)
    with whole_folder(folder, {"results.csv", "results.json"}, "results.csv") as part:
        write_whole(part / "results.json", f"{text}\n".encode("utf-8", "backslashreplace"))
        write_whole(part / "results.csv", results_csv([one.name for one in done], [one.numbers for one in done]))
    return folder / "results.csv"
