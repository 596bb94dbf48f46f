"""``springmass batch``: a course of runs to one table, a page and reports, resumable, here or on a cluster."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from typing import Annotated

from cyclopts import Parameter

from springmass.commands.options import File, refuse
from springmass.course.page import GROUPS, PAGE
from springmass.course.plan import plan, template
from springmass.course.rows import CSV, FAILED
from springmass.course.running import run_course
from springmass.course.store import DATABASE, opened
from springmass.errors import OK, SOME_FAILED, UNREADABLE, ProgramError, complain, suggest, tell
from springmass.parameters import Count, WholeNumber, argument, flag, option, output
from springmass.runs.options import How
from springmass.runs.outputs import make_folder
from springmass.terminal.printing import visible_lines
from springmass.typeset import count


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
    jobs: Annotated[Count | None, option("N", "number of processes (default: one per core)")] = None
    dask: Annotated[str | None, option("ADDRESS", "analyse on the workers of this dask scheduler")] = None
    reports: Annotated[
        WholeNumber, option("N", "write full reports of the N runs that most need a look (default: 20)")
    ] = 20


def batch(
    *recordings: Annotated[File, argument("INPUT", "recordings, folders (with subfolders), or patterns")],
    options: BatchOptions = BatchOptions(),
    how: How = How(),
) -> int:
    """Analyse new and changed runs, and write the table and the page of all runs."""
    refuse("batch", how, "velocity")
    inputs = [str(each) for each in recordings]
    if not inputs and options.runs is None:
        raise ProgramError("batch needs recordings, folders or --runs FILE, got none of them")
    if options.template:
        table = template([job.path for job in plan(inputs).jobs])
        # A file gets the paths unchanged, because they are read back from it.
        print(visible_lines(table) if sys.stdout.isatty() else table.removesuffix("\n"))
        return OK
    if options.output is None:
        raise ProgramError("batch needs a folder for the results; name it with -o DIR")
    if options.dask is not None and options.jobs:
        raise ProgramError("--dask brings its workers, got --jobs too; leave out --jobs")
    folder = make_folder(options.output)
    with opened(folder) as store:
        course = plan(
            inputs,
            runs_csv=None if options.runs is None else str(options.runs),
            scene=None if options.scene is None else str(options.scene),
            how=how,
            known=[json.loads(key)[0] for key in store.made_of()],
            output=str(folder),
        )
        for line in course.notes:
            tell(line)
        rows, made, unwritten = run_course(
            course, store, folder, jobs=options.jobs, dask=options.dask, reports=options.reports
        )
    for line in unwritten:
        complain(line)
    failed = sum(row["status"] in FAILED for row in rows)
    tell(f"{count(len(rows), 'run')}: {len(rows) - made} unchanged, {made} analysed, {failed} failed")
    suggest(f"open {folder / PAGE} in a browser")
    tell(f"written: {folder / PAGE}, {folder / GROUPS}, {folder / CSV}; the data are in {folder / DATABASE}")
    if failed and failed == len(rows):
        return UNREADABLE
    return SOME_FAILED if failed or unwritten else OK
