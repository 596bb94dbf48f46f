"""``springmass batch``: a course of runs to one table, a page and reports, resumable, here or on a cluster."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from springmass.batch.course import template
from springmass.batch.plan import plan
from springmass.batch.rows import FAILED
from springmass.batch.running import run_course
from springmass.batch.store import CSV, GROUPS, PAGE
from springmass.commands.options import File, StatedLaw, Tier, argument, flag, option, output, refuse
from springmass.errors import OK, SOME_FAILED, UNREADABLE, USAGE, ProgramError, complain, manner, suggest, tell
from springmass.runs.options import ReadOptions
from springmass.terminal.printing import visible_lines
from springmass.terminal.progress import TaskProgress
from springmass.values import Count, WholeNumber


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class BatchOptions:
    """The options of ``springmass batch``."""

    output: Annotated[
        File | None, output("DIR", "folder for table, page and reports; an existing course is continued")
    ] = None
    runs: Annotated[File | None, option("FILE", "CSV table with what you know about each run")] = None
    template: Annotated[bool, flag("print an empty table for --runs to fill in")] = False
    scene: Annotated[File | None, option("FILE", "scene file for all runs; values in the table take precedence")] = None
    accuracy: Tier = "standard"
    law: StatedLaw = None
    jobs: Annotated[Count | None, option("N", "number of processes (default: one per core)")] = None
    dask: Annotated[str | None, option("ADDRESS", "analyse on the workers of this dask scheduler")] = None
    rehash: Annotated[bool, flag("read every file again to check whether it has changed")] = False
    reports: Annotated[
        WholeNumber, option("N", "write full reports of the N runs that most need a look (default: 20)")
    ] = 20


def batch(
    *recordings: Annotated[
        File, argument("INPUT", "recordings, folders (with subfolders), patterns, or @FILE (a list)")
    ],
    options: BatchOptions = BatchOptions(),
    read: ReadOptions = ReadOptions(),
) -> int:
    """Analyse new and changed runs, and write the table and the page of all runs."""
    refuse("batch", read, "velocity")
    inputs = [str(each) for each in recordings]
    if not inputs and options.runs is None:
        raise ProgramError("batch needs recordings, folders or --runs FILE, got none of them", USAGE)
    if options.template:
        table = template([job.path for job in plan(inputs).jobs])
        # A file gets the paths unchanged, because they are read back from it.
        print(visible_lines(table) if sys.stdout.isatty() else table.removesuffix("\n"))
        return OK
    if options.output is None:
        raise ProgramError("batch needs a folder for the results; name it with -o DIR", USAGE)
    if options.dask is not None and options.jobs:
        raise ProgramError("--dask brings its workers, got --jobs too; leave out --jobs", USAGE)
    quiet = manner()[0]
    with contextlib.ExitStack() as shown:
        runs = shown.enter_context(TaskProgress("runs", lines=True, quiet=quiet))
        reports: list[TaskProgress] = []

        def analysed(rows: Sequence[Mapping[str, Any]], done: int, total: int) -> None:
            for row in rows:
                if row["status"] in FAILED:
                    complain(row["error"])
            runs.update(done, total)

        def reported(done: int, total: int) -> None:
            if not reports:  # the bar for reports replaces that for runs
                shown.pop_all().close()
                reports.append(shown.enter_context(TaskProgress("reports", lines=True, quiet=quiet)))
            reports[0].update(done, total)

        outcome = run_course(
            inputs,
            str(options.output),
            runs_csv=None if options.runs is None else str(options.runs),
            scene=None if options.scene is None else str(options.scene),
            accuracy=options.accuracy,
            law=options.law,
            answers=read.given(),
            jobs=options.jobs,
            dask=options.dask,
            rehash=options.rehash,
            reports=options.reports,
            note=tell,
            progress=analysed,
            reported=reported,
        )
    folder = Path(options.output)
    for name, kept in outcome.edited:
        complain(f"{folder / name}: was edited; kept as {kept} and written again")
    for line in (*outcome.damaged, *outcome.unwritten):
        complain(line)
    failed = len(outcome.failures)
    tell(f"{outcome.runs} runs: {outcome.unchanged} unchanged, {outcome.analysed} analysed, {failed} failed")
    tell(f"written: {folder / CSV}, {folder / PAGE}, {folder / GROUPS}")
    suggest(f"open {folder / PAGE} in a browser")
    if failed and failed == outcome.runs:
        return UNREADABLE
    return SOME_FAILED if failed or outcome.unwritten else OK
