"""``springmass report``: the full report of one run of a course."""

from __future__ import annotations

import argparse
from pathlib import Path

from springmass.batch.page import line_of, write_page
from springmass.batch.plan import names_of
from springmass.batch.reports import REPORTS, find_run, jobs_of, linked, report_name, write_one
from springmass.batch.store import demand_course
from springmass.errors import OK, suggest, tell
from springmass.runs.analysing import make_folder

__all__ = ["run"]


def run(options: argparse.Namespace) -> int:
    """Analyse the run as the course did, write its report, and link it on the course's page."""
    folder = Path(options.input)
    store = demand_course(folder)
    jobs = jobs_of(store)
    names = names_of(jobs)
    name, job = find_run(store, dict(zip(names, jobs, strict=True)), options.name)
    make_folder(folder / REPORTS)
    page = write_one(name, job, folder / REPORTS / report_name(name))
    tags = list(dict.fromkeys(tag for each in jobs for tag in each.tags))
    lines = [line_of(name, row, tags) for name, row in zip(names, store.all(), strict=True)]
    write_page(folder, lines, tags, linked(folder))
    tell(f"report: {page}")
    suggest(f"open {page} in a browser")
    return OK
