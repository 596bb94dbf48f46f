"""``springmass analyse``: from recordings to Table 1, findings and a report.

Several inputs are analysed one after the other: twenty records of two minutes take 1.4 s, and a second process would
take longer to begin (``benchmarks/many.py``).
"""

from __future__ import annotations

import filecmp
import json
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Group, Parameter

from acquisition.errors import AcquisitionError, NeedsAnswer
from pipeline.analyse import Oscillation, Overdamped
from pipeline.bench.scene import Scene
from pipeline.errors import PipelineError
from pipeline.numerics.estimate import Estimate
from springmass.commands.options import Figures, File, Scenes, StatedLaw, Strict, Tier, argument, flag, option, output
from springmass.errors import (
    INTERNAL,
    NO_MEMORY,
    OK,
    REJECTED,
    SOME_FAILED,
    UNREADABLE,
    USAGE,
    ProgramError,
    complain,
    internal_error,
    manner,
    suggest,
    tell,
)
from springmass.layout import STDIN
from springmass.runs.about import remember_scene
from springmass.runs.analysing import (
    Analysed,
    analyse_loaded,
    distinct_names,
    in_a_name,
    law_line,
    make_folder,
    scene_of,
)
from springmass.runs.inputs import InputFile, files_of
from springmass.runs.json_results import picked, rejected
from springmass.runs.loading import Loaded, load, sample_data
from springmass.runs.options import ReadOptions
from springmass.runs.questions import for_command, option_of
from springmass.runs.scenes import Amendments, amended, read_scenes
from springmass.terminal.asking import ask_for_bench
from springmass.values import Finite, NotNegative
from storage.errors import StorageError, WriteFailed

if TYPE_CHECKING:
    from springmass.report.tables import TableKey

READING = ("velocity", "channel", "rate_hz", "unit", "from_s", "to_s", "clock_ppm")
RESOLVED = ("accuracy", "method", "law", "strict")
TOGETHER = "together.results"
STDIN_NAME = "stdin"
LONGEST_INPUTS = 48  # maximum length of input names repeated in a suggested command


@dataclass(frozen=True, slots=True)
class _Task:
    """One input and what to make from it."""

    file: InputFile
    name: str
    scene: Scene | None
    scene_file: str | Path | None
    options: AnalyseOptions
    read: ReadOptions
    bench: Amendments
    alone: bool
    writes: bool = False  # whether files may be written at all
    report: Path | None = None  # folder for the report


@dataclass(frozen=True, slots=True)
class _Done:
    """The outcome of one of several inputs: of a course of thousands, only what is printed at the end."""

    name: str
    code: int
    complaints: tuple[str, ...] = ()
    result: Mapping[str, Any] = field(default_factory=dict)
    table: Mapping[TableKey, Estimate] = field(default_factory=dict)
    numbers: Mapping[str, Estimate] = field(default_factory=dict)
    page: Path | None = None
    remembered: bool = False  # whether the scene was noted next to the recording
    law: str = ""  # line that names the damping law stated by the scene


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class AnalyseOptions:
    """The options of ``springmass analyse``."""

    scene: Scenes = ()
    accuracy: Tier = "standard"
    law: StatedLaw = None
    method: Annotated[
        Literal["classic"] | None, option("NAME", "also apply the lab report's classic method, for comparison")
    ] = None
    output: Annotated[File | None, output("DIR", "output folder (default: here; with --json: none)")] = None
    report: Annotated[bool, flag("with several inputs, also write a report for each")] = False
    no_report: Annotated[bool, flag("print the results, but write no files")] = False
    full: Annotated[bool, flag("print all warnings and notes, and the sources of uncertainty")] = False
    budget: Annotated[bool, flag("print the sources of uncertainty")] = False
    ask: Annotated[bool, flag("ask for the masses and the disc, and save them next to the recording")] = False
    template: Annotated[Literal["latex"] | None, option("KIND", "also write a lab report template: latex")] = None
    figures: Figures = ()
    si: Annotated[bool, flag("print SI units without prefixes")] = False
    json: Annotated[bool, flag("print one JSON object per input on standard output")] = False
    strict: Strict = False


@Parameter(name="*", group=Group("The bench, instead of the values in the scene", sort_key=3))
@dataclass(frozen=True, kw_only=True)
class BenchOptions:
    """Values of the bench, each with its standard uncertainty."""

    mass_kg: Annotated[Finite | None, option("X", "total mass that hangs on the spring, kg")] = None
    mass_u_kg: Annotated[NotNegative | None, option("U", "its standard uncertainty (default: exact)")] = None
    spring_mass_kg: Annotated[Finite | None, option("X", "mass of the spring, kg")] = None
    spring_mass_u_kg: Annotated[NotNegative | None, option("U", "its standard uncertainty")] = None
    disc_diameter_m: Annotated[Finite | None, option("X", "diameter of the disc, m")] = None
    disc_diameter_u_m: Annotated[NotNegative | None, option("U", "its standard uncertainty")] = None
    temperature_c: Annotated[Finite | None, option("X", "temperature of the air, degrees Celsius")] = None
    temperature_u_c: Annotated[NotNegative | None, option("U", "its standard uncertainty")] = None


BENCH = {
    ("bob", "mass_kg"): ("mass_kg", "mass_u_kg"),
    ("spring", "mass_kg"): ("spring_mass_kg", "spring_mass_u_kg"),
    ("disc", "diameter_m"): ("disc_diameter_m", "disc_diameter_u_m"),
    ("air", "temperature_c"): ("temperature_c", "temperature_u_c"),
}
"""Table and key of the scene, mapped to the fields of :class:`BenchOptions` for the value and its uncertainty."""


def analyse(
    *recordings: Annotated[
        File, argument("INPUT", "recordings, run files or folders of these; - for standard input", required=True)
    ],
    options: AnalyseOptions = AnalyseOptions(),
    read: ReadOptions = ReadOptions(),
    bench: BenchOptions = BenchOptions(),
) -> int:
    """Analyse every input; if one fails, the others still give results."""
    inputs = [str(each) for each in recordings]
    if options.report and options.no_report:
        raise ProgramError("--report and --no-report exclude each other, got both; leave one out", USAGE)
    if read.velocity is not None and (len(inputs) > 1 or Path(inputs[0]).is_dir()):
        got = f"{len(inputs)} inputs" if len(inputs) > 1 else "a folder"
        raise ProgramError(f"--velocity completes one position file, got {got}; analyse the pair by itself", USAGE)
    if options.ask and (len(inputs) > 1 or Path(inputs[0]).is_dir()):
        raise ProgramError("--ask is about one recording; analyse the others by themselves", USAGE)
    if options.ask and inputs == [STDIN]:
        raise ProgramError("--ask reads answers from standard input, which is the recording; give --mass-kg", USAGE)
    scenes = read_scenes(options.scene, len(inputs))
    values = _values(bench)
    found, folders = files_of(inputs)
    out = make_folder(options.output or ".") if _writes(options) else None
    for line in folders:
        tell(line)
    every = len(found) == 1 or options.report
    tasks = [
        _Task(
            one,
            name,
            scenes[one.of],
            options.scene[one.of if len(options.scene) > 1 else 0] if options.scene else None,
            options,
            read if one.velocity is None else replace(read, velocity=one.velocity),
            values,
            inputs == [one.path],
            out is not None,
            out / in_a_name(name, ".results") if out is not None and every else None,
        )
        for one, name in zip(
            found, distinct_names([STDIN_NAME if one.path == STDIN else one.path for one in found]), strict=True
        )
    ]
    return _one(tasks[0]) if len(tasks) == 1 else _several(tasks, inputs, options, out)


def _writes(options: AnalyseOptions) -> bool:
    return not options.no_report and (options.report or options.output is not None or not options.json)


def _one(task: _Task) -> int:
    attempted = _attempt(task)
    if isinstance(attempted, _Done):
        complain(*attempted.complaints)
        return attempted.code
    analysed, noted = attempted
    if task.options.json:
        print(json.dumps(analysed.result, allow_nan=False), flush=True)
    else:
        if line := law_line(analysed.analysis, Path(task.file.path), task.scene_file):
            print(line)
        _print_text(analysed, task.options)
    if noted is not None:
        tell(f"bench data saved for this file: {noted}")
    if task.report is not None:
        page = _write(analysed, task)
        tell(f"report: {page}")
    code, complaints = _judged(analysed, task)
    for line in complaints:
        complain(line)
    return code


def _several(tasks: Sequence[_Task], inputs: Sequence[str], options: AnalyseOptions, out: Path | None) -> int:
    """Analyse many inputs: one Table 1, one file of numbers."""
    from springmass.terminal.progress import counted

    everything: list[_Done] = []
    for done in counted(map(_work, tasks), len(tasks), "reports" if options.report else "runs", quiet=manner()[0]):
        everything.append(done)
        if options.json and done.result:
            print(json.dumps(done.result, allow_nan=False), flush=True)
        if done.page is not None:
            tell(f"report: {done.page}")
        for line in done.complaints:
            complain(line)
    analysed = [done for done in everything if done.result]
    if noted := sum(done.remembered for done in everything):
        tell(f"bench data saved for {noted} recordings, each in NAME.about.toml")
    if analysed and not options.json:
        _print_together(analysed, options)
    if analysed and out is not None:
        tell(f"written: {_write_together(analysed, out / TOGETHER)}")
    if len(analysed) > 1:
        named = shlex.join(inputs)
        suggest(f"springmass compare {named if len(named) <= LONGEST_INPUTS else '...'}")
    codes = [done.code for done in everything]
    if len(set(codes)) > 1 and any(code not in (OK, REJECTED) for code in codes):
        return SOME_FAILED
    return max(codes)


def _work(task: _Task) -> _Done:
    """Analyse one of several inputs, and write its report; a defect met on one does not keep the others from theirs."""
    try:
        return _analyse_and_report(task)
    except MemoryError:
        return _Done(task.name, UNREADABLE, (f"{task.file.path}: {NO_MEMORY}",))
    except Exception as error:
        return _Done(task.name, INTERNAL, (f"{task.file.path}: {internal_error(error)}",))


def _analyse_and_report(task: _Task) -> _Done:
    from springmass.report.tables import every_number, table_estimates

    attempted = _attempt(task)
    if isinstance(attempted, _Done):
        return attempted
    analysed, noted = attempted
    code, complaints = _judged(analysed, task)
    page = None
    if task.report is not None:
        try:
            page = _write(analysed, task)
        except WriteFailed as error:
            code, complaints = USAGE, (*complaints, str(error))
    analysis = analysed.analysis
    table, numbers = table_estimates(analysis), every_number(analysis)
    law = law_line(analysis, Path(task.file.path), task.scene_file)
    return _Done(task.name, code, complaints, analysed.result, table, numbers, page, noted is not None, law)


def _attempt(task: _Task) -> tuple[Analysed, Path | None] | _Done:
    """Analyse an input; return the analysis, and where its scene was saved."""
    try:
        options, read = task.options, task.read
        loaded, bench = load(task.file.path, read, scene_given=task.scene is not None), dict(task.bench)
        if options.ask:
            known = amended(scene_of(loaded, task.scene), bench, where="the command line") if bench else None
            bench |= ask_for_bench(known or scene_of(loaded, task.scene), loaded.path.name)
        run = analyse_loaded(
            loaded,
            task.scene,
            bench=bench,
            accuracy=options.accuracy,
            law=options.law,
            with_classic=options.method == "classic",
        )
        parameters = {
            **picked(options, ("accuracy", "method", "law")),
            **picked(read, READING),
            "strict": options.strict,
        }
        scene = run.analysis.scene if task.scene is not None or bench else None
        return run.described(parameters), _remembered(loaded, scene) if task.writes or options.ask else None
    except ProgramError as error:
        return _Done(task.name, error.exit_code, (str(error),))
    except NeedsAnswer as question:
        if task.alone:
            raise  # the caller answers it with the typed command line
        remedy = for_command(question.question, _words(task), replace(task.read, velocity=None).given())
        return _Done(task.name, UNREADABLE, (str(question.with_remedy(remedy)),))
    except (AcquisitionError, StorageError) as error:
        return _Done(task.name, UNREADABLE, (str(error),))
    except PipelineError as error:
        return _Done(task.name, UNREADABLE, (f"{task.file.path}: {error}",))


def _words(task: _Task) -> list[str]:
    """Return the command line for one of several inputs by itself."""
    velocity = () if task.file.velocity is None else ("--velocity", task.file.velocity)
    path = task.file.path
    return ["springmass", "analyse", f"./{path}" if path.startswith("-") else path, *velocity]


def _remembered(loaded: Loaded, scene: Scene | None) -> Path | None:
    """Save a given scene next to its recording; if that is impossible, print a message and continue."""
    if scene is None or loaded.path == Path(STDIN) or _bundled(loaded.path):
        return None
    try:
        return remember_scene(loaded.path, loaded.scene, scene)
    except WriteFailed as error:
        tell(f"{error}; the bench data are not saved")
        return None


def _bundled(path: Path) -> bool:
    """Whether a recording came with the program, wherever it is now: nothing is written into its folder."""
    own = sample_data() / path.name
    return own.is_file() and filecmp.cmp(own, path, shallow=False)


def _values(bench: BenchOptions) -> dict[tuple[str, str], dict[str, float]]:
    """Return the values of the bench that were given, by table and key of the scene."""
    values = {}
    for place, (of_value, of_u) in BENCH.items():
        value, u = getattr(bench, of_value), getattr(bench, of_u)
        if value is not None:
            values[place] = {"value": value, "u": u or 0.0}
        elif u is not None:
            raise ProgramError(
                f"{option_of(of_u)} does nothing without {option_of(of_value)}; name both or neither", USAGE
            )
    return values


def _judged(analysed: Analysed, task: _Task) -> tuple[int, tuple[str, ...]]:
    """Return the exit code of an analysis, and the message for it."""
    path, motion = analysed.result["input"]["path"], analysed.analysis.motion
    if not isinstance(motion, (Oscillation, Overdamped)):
        return UNREADABLE, (f"{path}: no oscillation: {motion.why}",)
    if task.options.strict and (wrong := rejected(analysed.result["findings"])):
        return REJECTED, (f"{path}: rejected under --strict: {', '.join(wrong)}",)
    return OK, ()


def _print_text(analysed: Analysed, options: AnalyseOptions) -> None:
    """Print Table 1, one sentence on damping and the warnings, and further parts on request."""
    from springmass.report.budgets import budget_text
    from springmass.report.trust import trust_text
    from springmass.report.words import damping_sentence, typeset
    from springmass.terminal.printing import classic_text, findings_text, fitted, wrapped
    from springmass.terminal.style import style_of
    from springmass.terminal.table1 import text_table

    style = style_of(sys.stdout, si=options.si)
    print(text_table([analysed.name], [analysed.analysis], style))
    if analysed.classic is not None:
        print(f"{classic_text(analysed.classic)}\n")
    if (options.full or options.budget) and (budget := budget_text(analysed.analysis)):
        print(f"{fitted(budget, style.width) if style.terminal else budget}\n")
    for text in (trust_text(analysed.analysis, page=style.unicode), damping_sentence(analysed.analysis)):
        if text:
            print(f"{wrapped(text, '', 80)}\n")
    print(findings_text(analysed.result["findings"], typeset if style.unicode else str, full=options.full))


def _print_together(analysed: Sequence[_Done], options: AnalyseOptions) -> None:
    from springmass.report.words import typeset
    from springmass.terminal.printing import shared_findings_text
    from springmass.terminal.style import style_of
    from springmass.terminal.table1 import text_table

    for line in dict.fromkeys(done.law for done in analysed if done.law):
        print(line)
    names = [done.name for done in analysed]
    style = style_of(sys.stdout, si=options.si)
    print(text_table(names, [done.table for done in analysed], style))
    findings = {done.name: done.result["findings"] for done in analysed}
    print(shared_findings_text(findings, typeset if style.unicode else str))


def _write(analysed: Analysed, task: _Task) -> Path:
    from springmass.report.write import write_report

    assert task.report is not None
    return write_report(task.report, [analysed], figures=task.options.figures, template=task.options.template)


def _write_together(analysed: Sequence[_Done], folder: Path) -> Path:
    """Write the numbers of all runs: results.csv for a table, results.json for programs."""
    from springmass.report.tables import results_csv
    from storage.atomic import write_whole
    from storage.folder import whole_folder

    names = [done.name for done in analysed]
    with whole_folder(folder, {"results.csv", "results.json"}, "results.csv") as part:
        text = json.dumps([done.result for done in analysed], indent=2, allow_nan=False, ensure_ascii=False)
        write_whole(part / "results.json", f"{text}\n".encode("utf-8", "backslashreplace"))
        write_whole(part / "results.csv", results_csv(names, [done.numbers for done in analysed]))
    return folder / "results.csv"
