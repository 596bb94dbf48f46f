"""Make one pass over a course: analyse new and changed runs, then write table, page and reports of all rows."""

from __future__ import annotations

import hashlib
import heapq
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from springmass.course.benches import compare_rows
from springmass.course.executors import outcomes, workers
from springmass.course.page import line_of, mark, write_groups, write_page
from springmass.course.plan import Job, Plan, code_sha256, names_of
from springmass.course.rows import COURSE, FAILED, write_rows
from springmass.course.store import Store
from springmass.course.worker import analyse_one, blank_row, write_report_of
from springmass.errors import ProgramError, complain, manner
from springmass.report.html import SHARED, report_script
from springmass.runs.outputs import safe_name
from springmass.terminal.progress import counting
from storage.atomic import write_whole

GROWTH = 1.1  # results.csv is written again when there are so many times as many rows, so that it takes little time
REPORTS = "reports"
_DIED = "its worker process died twice, for lack of memory perhaps; the next pass tries it again"
Row = dict[str, Any]


def run_course(
    course: Plan, store: Store, folder: Path, *, jobs: int | None, dask: str | None, reports: int
) -> tuple[list[Row], int, list[str]]:
    """Analyse the new and changed runs of a course, and write table, page and reports of all runs.

    Runs that fail are reported as they do. Return all rows, how many were made, and a line for each unwritten report.
    """
    made_of = {job.key: job.made_of() for job in course.jobs}
    stored = store.made_of()
    todo = [job for job in course.jobs if stored.get(job.key) != made_of[job.key]]
    if todo:
        from springmass.report.write import remove_report

        for page in (folder / REPORTS).glob("*.results/report.html"):
            remove_report(page.parent)  # it may show a run that has changed; an interrupted pass leaves none of these
    done = made_of.keys() - {job.key for job in todo}
    made, written = 0, len(done)
    with counting("runs", len(todo), lines=True, quiet=manner()[0]) as show:
        for rows in _analysed(todo, jobs, dask):
            # A run during which a worker died is tried again by the next pass.
            store.add((job.key, "" if row["status"] == "ended" else made_of[job.key], row) for job, row in rows)
            done |= {job.key for job, _ in rows}
            made += len(rows)
            if len(done) >= GROWTH * written:
                write_rows(folder, _table(course, store, done), course.tags)
                written = len(done)
            for _, row in rows:
                if row["status"] in FAILED:
                    complain(row["error"])
            show(made)
    table = _table(course, store, done)
    write_rows(folder, table, course.tags)
    return table, made, _write_pages(course, folder, table, reports, jobs)


def _table(course: Plan, store: Store, done: set[str]) -> list[Row]:
    """Return the rows of the runs that have one, in the order of the runs, with their names and tags."""
    named = [pair for pair in zip(course.jobs, names_of(course.jobs), strict=True) if pair[0].key in done]
    rows = store.rows([job.key for job, _ in named])
    return [
        {**row, "run": name, COURSE: "", **{tag: job.tags.get(tag) for tag in course.tags}}
        for (job, name), row in zip(named, rows, strict=True)
    ]


def _analysed(todo: Sequence[Job], jobs: int | None, dask: str | None) -> Iterator[list[tuple[Job, Row]]]:
    """Yield jobs with their rows; a run during which worker processes die gets a row stating this."""
    if not todo:
        return
    with workers(len(todo), jobs, dask) as by:
        for done in outcomes(analyse_one, todo, by):
            rows = [(job, row or blank_row(job, "ended", f"{job.path}: {_DIED}")) for job, row in done]
            if any(row["code_sha256"] != code_sha256() for _, row in rows):
                wrong = "a worker has another version of springmass or of its libraries; install the same everywhere"
                raise ProgramError(f"{dask}: {wrong}")
            yield rows


def _write_pages(course: Plan, folder: Path, table: Sequence[Row], reports: int, jobs: int | None) -> list[str]:
    """Write what to tell the groups, missing reports of the worst runs, and the page; return what cannot be written."""
    write_whole(folder / SHARED, report_script())
    lines = [line_of(row, course.tags) for row in table]
    if sum(row["status"] == "ok" for row in table) > 1:
        mark(lines, compare_rows(table))
    write_groups(folder, lines, course.tags)
    for line, job in zip(lines, course.jobs, strict=True):
        line["link"] = _report_of(line, job)
    drawn = [(line, job) for line, job in zip(lines, course.jobs, strict=True) if line["need"][0] < 2]
    worst = heapq.nlargest(reports, drawn, key=lambda pair: (pair[0]["need"], pair[0]["name"]))
    named = [(line["name"], job, folder / line["link"]) for line, job in worst]
    tasks = [(name, job, page.parent) for name, job, page in named if not page.exists()]
    unwritten: list[str] = []
    finished = 0
    progress = counting("reports", len(tasks), lines=True, quiet=manner()[0])
    with workers(len(tasks), jobs) as by, progress as show:
        for written in outcomes(write_report_of, tasks, by):
            unwritten += [f"{job.path}: {_DIED}" if why is None else why for (_, job, _), why in written if why != ""]
            finished += len(written)
            show(finished)
    for line in lines:
        line["link"] = line["link"] if (folder / line["link"]).exists() else ""
    write_page(folder, table, lines, course.tags)
    return sorted(unwritten)


def _report_of(line: Mapping[str, Any], job: Job) -> str:
    """Return the path of a run's report in the folder; names are numbered anew if a run is removed, keys are not."""
    safe = safe_name(line["name"], longest=100)
    return f"{REPORTS}/{safe}-{hashlib.sha256(job.key.encode()).hexdigest()[:8]}.results/report.html"
