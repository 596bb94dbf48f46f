"""``springmass report``: the full report of one run of a course."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

from springmass.batch.page import line_of, write_page
from springmass.batch.plan import Job
from springmass.batch.reports import REPORTS, find_run, linked, report_name, write_one, write_script
from springmass.batch.store import open_course
from springmass.commands.options import File, argument
from springmass.errors import OK, suggest, tell
from springmass.runs.outputs import make_folder


def report(
    course: Annotated[File, argument("DIR", "folder that batch created")],
    run_name: Annotated[str, argument("RUN", "name of a run in its table, or path of its recording")],
    /,
) -> int:
    """Analyse the run as the course did, write its report, and link it on the course's page."""
    folder = Path(course)
    store = open_course(folder)
    here = os.getcwd()
    jobs, lines = {}, []
    for row in store.all():
        jobs[row["run"]] = Job.from_mapping(row["job"], here)
        lines.append(line_of(row, store.tags))
    name, job = find_run(folder, jobs, run_name)
    make_folder(folder / REPORTS)
    with store.held():
        write_script(folder)
        page = write_one(name, job, folder / REPORTS / report_name(name))
        write_page(store, lines, store.tags, linked(folder))
    tell(f"report: {page}")
    suggest(f"open {page} in a browser")
    return OK
