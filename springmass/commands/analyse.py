"""``springmass analyse``: recordings to Table 1, findings and a report.

Several inputs are analysed one after the other: twenty records of two minutes take 1.4 s, and a second process would
take longer to begin (``benchmarks/many.py``). Their reports, a second each and more, are made by a process a core.
"""

from __future__ import annotations

import argparse
import filecmp
import json
import shlex
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from acquisition.errors import AcquisitionError, NeedsAnswer
from pipeline.analyse import Oscillation, Overdamped
from pipeline.bench.scene import Scene
from pipeline.errors import PipelineError
from pipeline.numerics.estimate import Estimate
from springmass.commands import completions, worded_for
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
    suggest,
    tell,
)
from springmass.runs.about import remember_scene
from springmass.runs.analysing import Analysed, analyse_loaded, distinct_names, in_a_name, make_folder, scene_of
from springmass.runs.inputs import Found, files_of
from springmass.runs.json_results import picked, rejected
from springmass.runs.loading import Loaded, load, sample_data
from springmass.runs.processes import cores, pool
from springmass.runs.scenes import amended, read_scenes
from springmass.terminal.arguments import BENCH
from storage.errors import StorageError, WriteFailed

__all__ = ["run"]

PARAMETERS = ("accuracy", "method", "velocity", "channel", "rate_hz", "unit", "from_s", "to_s", "clock_ppm", "strict")
TOGETHER = "together.results"
LONGEST_INPUTS = 48  # characters: names that are repeated in what to type next


@dataclass(frozen=True, slots=True)
class _Task:
    """One input, and what is to be made of it."""

    found: Found
    name: str
    scene: Scene | None
    options: argparse.Namespace
    writes: bool = False  # whether files may be written at all
    report: Path | None = None  # the folder for it


@dataclass(frozen=True, slots=True)
class _Done:
    """What became of one of several inputs: small enough to come from another process."""

    name: str
    code: int
    complaints: tuple[str, ...] = ()
    result: Mapping[str, Any] = field(default_factory=dict)
    table: Mapping[str, Estimate] = field(default_factory=dict)
    numbers: Mapping[str, Estimate] = field(default_factory=dict)
    page: Path | None = None
    remembered: bool = False  # whether its scene was noted beside it


def run(options: argparse.Namespace) -> int:
    """Analyse every input; one that fails does not keep the others from their results."""
    if options.velocity is not None and (len(options.input) > 1 or Path(options.input[0]).is_dir()):
        got = f"{len(options.input)} inputs" if len(options.input) > 1 else "a folder"
        raise ProgramError(f"--velocity completes one position file, got {got}; analyse the pair by itself", USAGE)
    scenes = read_scenes(options.scene, len(options.input))
    found, said = files_of(options.input)
    out = make_folder(options.out or ".") if _writes(options) else None
    for line in said:
        tell(line)
    every = len(found) == 1 or options.report
    tasks = [
        _Task(
            one,
            name,
            scenes[one.of],
            options,
            out is not None,
            out / in_a_name(name, ".results") if out is not None and every else None,
        )
        for one, name in zip(found, distinct_names([one.path for one in found]), strict=True)
    ]
    return _one(tasks[0]) if len(tasks) == 1 else _several(tasks, options, out)


def _writes(options: argparse.Namespace) -> bool:
    return not options.no_report and (options.report or options.out is not None or not options.json)


def _one(task: _Task) -> int:
    attempted = _attempt(task)
    if isinstance(attempted, _Done):
        complain(*attempted.complaints)
        return attempted.code
    analysed, noted = attempted
    if task.options.json:
        print(json.dumps(analysed.result, allow_nan=False), flush=True)
    else:
        _print_text(analysed, si=task.options.si)
    if noted is not None:
        tell(f"{noted}: this scene, used from now on with {task.found.path}")
    if task.report is not None:
        page = _write(analysed, task.report, pdf=task.options.pdf)
        tell(f"report: {page}")
        suggest(f"open {page} in a browser")
    code, complaints = _judged(analysed, task)
    for line in complaints:
        complain(line)
    return code


def _several(tasks: Sequence[_Task], options: argparse.Namespace, out: Path | None) -> int:
    """Analyse many inputs: one Table 1, one file of numbers."""
    from springmass.terminal.counting import counted

    everything: list[_Done] = []
    for done in counted(_worked(tasks), len(tasks), "reports" if options.report else "runs", quiet=options.quiet):
        everything.append(done)
        if options.json and done.result:
            print(json.dumps(done.result, allow_nan=False), flush=True)
        if done.page is not None:
            tell(f"report: {done.page}")
        for line in done.complaints:
            complain(line)
    analysed = [done for done in everything if done.result]
    if noted := sum(done.remembered for done in everything):
        tell(f"scenes noted beside {noted} recordings, NAME.about.toml, used from now on with them")
    if analysed and not options.json:
        _print_together(analysed, options)
    if analysed and out is not None:
        tell(f"written: {_write_together(analysed, out / TOGETHER)}")
    if len(analysed) > 1:
        inputs = shlex.join(options.input)
        suggest(f"springmass compare {inputs if len(inputs) <= LONGEST_INPUTS else '...'}")
    codes = [done.code for done in everything]
    if len(set(codes)) > 1 and any(code not in (OK, REJECTED) for code in codes):
        return SOME_FAILED
    return max(codes)


def _worked(tasks: Sequence[_Task]) -> Iterator[_Done]:
    """Yield what became of each task, in their order; with reports a process a core works on them."""
    workers = min(cores(), len(tasks))
    if tasks[0].report is None or workers == 1:
        yield from map(_work, tasks)
        return
    from concurrent.futures.process import BrokenProcessPool

    with pool(workers) as processes:
        try:
            yield from processes.map(_work, tasks)
        except BrokenProcessPool as error:
            demand = "a process that makes reports was ended from outside, for lack of memory perhaps"
            raise ProgramError(f"{demand}; give fewer inputs at once", SOME_FAILED) from error
        except BaseException:
            processes.shutdown(wait=False, cancel_futures=True)
            raise


def _work(task: _Task) -> _Done:
    """Analyse one of several inputs, and write its report; a defect met on one does not keep the others from theirs."""
    try:
        return _analyse_and_report(task)
    except MemoryError:
        return _Done(task.name, UNREADABLE, (f"{task.found.path}: {NO_MEMORY}",))
    except Exception as error:
        return _Done(task.name, INTERNAL, (f"{task.found.path}: {internal_error(error)}",))


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
            page = _write(analysed, task.report, pdf=task.options.pdf)
        except WriteFailed as error:
            code, complaints = USAGE, (*complaints, str(error))
    analysis = analysed.analysis
    table, numbers = table_estimates(analysis), every_number(analysis)
    return _Done(task.name, code, complaints, analysed.result, table, numbers, page, noted is not None)


def _attempt(task: _Task) -> tuple[Analysed, Path | None] | _Done:
    """Analyse an input; return that, and where its scene was noted from now on."""
    options = task.options
    asked = {**completions(options), "velocity": options.velocity or task.found.velocity}
    try:
        bench = _bench(options)
        loaded = load(task.found.path, **asked, from_s=options.from_s, to_s=options.to_s, clock_ppm=options.clock_ppm)
        scene = amended(scene_of(loaded, task.scene), bench, where="the command line") if bench else task.scene
        analysed = analyse_loaded(
            loaded,
            scene,
            parameters={**picked(options, PARAMETERS), "velocity": asked["velocity"]},
            accuracy=options.accuracy,
            with_classic=options.method == "classic",
        )
        return analysed, _remembered(loaded, scene) if task.writes else None
    except ProgramError as error:
        return _Done(task.name, error.exit_code, (str(error),))
    except NeedsAnswer as question:
        return _Done(task.name, UNREADABLE, (str(worded_for(options, question, _words(task))),))
    except (AcquisitionError, StorageError) as error:
        return _Done(task.name, UNREADABLE, (str(error),))
    except PipelineError as error:
        return _Done(task.name, UNREADABLE, (f"{task.found.path}: {error}",))


def _words(task: _Task) -> list[str] | None:
    """Return the command line for one of several inputs by itself; None where it is the only one, as it was typed."""
    if task.options.input == [task.found.path]:
        return None
    velocity = () if task.found.velocity is None else ("--velocity", task.found.velocity)
    path = task.found.path
    return ["springmass", "analyse", f"./{path}" if path.startswith("-") else path, *velocity]


def _remembered(loaded: Loaded, scene: Scene | None) -> Path | None:
    """Note a scene that was given beside its recording; where nothing can be written it is said, and done without."""
    if scene is None or _bundled(loaded.path):
        return None
    try:
        return remember_scene(loaded.path, loaded.scene, scene)
    except WriteFailed as error:
        tell(f"{error}; the scene is not noted beside {loaded.path}")
        return None


def _bundled(path: Path) -> bool:
    """Tell the recordings that come with the program, wherever they lie: their folder stays as it is."""
    own = sample_data() / path.name
    return own.is_file() and filecmp.cmp(own, path, shallow=False)


def _bench(options: argparse.Namespace) -> dict[tuple[str, str], dict[str, float]]:
    """Return what the command line says of the bench, by table and key of the scene."""
    found = {}
    for place, (option, of_u, _) in BENCH.items():
        value, u = (getattr(options, name[2:].replace("-", "_")) for name in (option, of_u))
        if value is not None:
            found[place] = {"value": value, "u": u or 0.0}
        elif u is not None:
            raise ProgramError(f"{of_u} does nothing without {option}; name both or neither", USAGE)
    return found


def _judged(analysed: Analysed, task: _Task) -> tuple[int, tuple[str, ...]]:
    """Return the exit code of an analysis, and what is to be said of it."""
    path, motion = analysed.result["input"]["path"], analysed.analysis.motion
    if not isinstance(motion, (Oscillation, Overdamped)):
        return UNREADABLE, (f"{path}: no oscillation: {motion.why}",)
    if task.options.strict and (wrong := rejected(analysed.result["findings"])):
        return REJECTED, (f"{path}: rejected under --strict: {', '.join(wrong)}",)
    return OK, ()


def _print_text(analysed: Analysed, *, si: bool) -> None:
    from springmass.report.budgets import budget_text
    from springmass.report.words import typeset
    from springmass.terminal.look import look_of
    from springmass.terminal.printing import classic_text, findings_text, fitted
    from springmass.terminal.table1 import text_table

    look = look_of(sys.stdout, si=si)
    print(text_table([analysed.name], [analysed.analysis], look))
    if analysed.classic is not None:
        print(f"\n{classic_text(analysed.classic)}")
    elif told := budget_text(analysed.analysis):
        print(fitted(told, look.width) if look.terminal else told)
    print()
    print(findings_text(analysed.result["findings"], typeset if look.unicode else str))


def _print_together(analysed: Sequence[_Done], options: argparse.Namespace) -> None:
    from springmass.report.words import typeset
    from springmass.terminal.look import look_of
    from springmass.terminal.printing import shared_findings_text
    from springmass.terminal.table1 import text_table

    names = [done.name for done in analysed]
    look = look_of(sys.stdout, si=options.si)
    print(text_table(names, [done.table for done in analysed], look))
    findings = {done.name: done.result["findings"] for done in analysed}
    print(shared_findings_text(findings, typeset if look.unicode else str))


def _write(analysed: Analysed, results: Path, *, pdf: bool) -> Path:
    from springmass.report.write import write_report

    return write_report(results, [analysed], pdf=pdf)


def _write_together(analysed: Sequence[_Done], folder: Path) -> Path:
    """Write the numbers of all runs: results.csv for a table, results.json for programs."""
    from springmass.report.tables import results_csv
    from storage.atomic import write_whole
    from storage.folder import whole_folder

    names = [done.name for done in analysed]
    with whole_folder(folder, {"results.csv", "results.json"}, "results.csv") as part:
        told = json.dumps([done.result for done in analysed], indent=2, allow_nan=False, ensure_ascii=False)
        write_whole(part / "results.json", f"{told}\n".encode("utf-8", "backslashreplace"))
        write_whole(part / "results.csv", results_csv(names, [done.numbers for done in analysed]))
    return folder / "results.csv"
