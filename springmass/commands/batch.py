"""``springmass batch``: a course of runs to one table, a page and reports, resumable, here or on a cluster."""

import json
import sys
from typing import Annotated

from springmass.commands.given import GivenOptions
from springmass.commands.options import AnalysisArguments, FileArgument, ReadPairs
from springmass.commands.parameters import PositiveCount, WholeNumber, argument, flag, option, output
from springmass.commands.questions import for_course
from springmass.course.page import COURSE_PAGE, GROUPS_FILE
from springmass.course.plan import empty_table, plan
from springmass.course.results_csv import CSV, FAILED
from springmass.course.running import run_course
from springmass.course.store import DATABASE, opened
from springmass.errors import HINT, LOG, OK, SOME_FAILED, UNREADABLE, ProgramError
from springmass.result.output_names import make_folder
from springmass.terminal.printing import visible_lines
from springmass.typeset import count


def batch(
    *recordings: Annotated[FileArgument, argument("INPUT", "recordings, folders (with subfolders), or patterns")],
    output: Annotated[
        FileArgument | None, output("DIR", "folder for table, page and reports; an existing course is continued")
    ] = None,
    runs: Annotated[FileArgument | None, option("FILE", "CSV table with what you know about each run")] = None,
    template: Annotated[bool, flag("print an empty table for --runs to fill in")] = False,
    scene: Annotated[
        FileArgument | None, option("FILE", "scene file for all runs; values in the table take precedence")
    ] = None,
    jobs: Annotated[PositiveCount | None, option("N", "number of processes (default: one per core)")] = None,
    dask: Annotated[str | None, option("ADDRESS", "analyse on the workers of this dask scheduler")] = None,
    reports: Annotated[
        WholeNumber, option("N", "write full reports of the N runs that most need a look (default: 20)")
    ] = 20,
    reading: ReadPairs = ReadPairs(),
    analysis: AnalysisArguments = AnalysisArguments(),
    given: GivenOptions,
) -> int:
    """Analyse new and changed runs, and write the table and the page of all runs."""
    reading.refuse("on a course, whose pairs are found by their names", "velocity")
    how = analysis.of(reading.options)
    if not recordings and runs is None:
        raise ProgramError("batch needs recordings, folders or --runs FILE, got none of them")
    if template:
        given.only("with --template", "--template")
        table = empty_table([task.name for task in plan(recordings).tasks])
        # A file gets the paths unchanged, because they are read back from it.
        print(visible_lines(table) if sys.stdout.isatty() else table.removesuffix("\n"))
        return OK
    if output is None:
        raise ProgramError("batch needs a folder for the results", "name it with -o DIR")
    if dask is not None:
        given.refuse("with --dask, which brings its own workers", "--jobs")
    folder = make_folder(output)
    with opened(folder) as store:
        course = plan(
            recordings,
            runs_csv=runs,
            scene=scene,
            how=how,
            known_paths=[json.loads(key)[0] for key in store.made_of()],
            output=str(folder),
        )
        for line in course.notes:
            LOG.info(line)
        rows, made, unwritten = run_course(
            course, store, folder, jobs=jobs, dask=dask, reports=reports, remedy=for_course
        )
    for line in unwritten:
        LOG.warning(line)
    failed = sum(row["status"] in FAILED for row in rows)
    LOG.info(f"{count(len(rows), 'run')}: {len(rows) - made} unchanged, {made} analysed, {failed} failed")
    LOG.log(HINT, f"open {folder / COURSE_PAGE} in a browser")
    LOG.info(
        f"written: {folder / COURSE_PAGE}, {folder / GROUPS_FILE}, {folder / CSV}; the data are in {folder / DATABASE}"
    )
    if failed and failed == len(rows):
        return UNREADABLE
    return SOME_FAILED if failed or unwritten else OK
