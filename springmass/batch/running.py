"""Make one pass over a course: analyse new and changed runs, then write table, page and reports of all rows."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from springmass.batch.benches import compare_rows
from springmass.batch.executors import outcomes, workers
from springmass.batch.page import line_of, mark, write_groups, write_page
from springmass.batch.plan import Job, Plan, code_sha256, names_of
from springmass.batch.reports import remove_others, report_of, write_missing
from springmass.batch.rows import COURSE, FAILED, write_rows
from springmass.batch.store import Store
from springmass.batch.worker import analyse_many, blank_row
from springmass.errors import USAGE, ProgramError
from springmass.report.script import SHARED, report_script
from storage.atomic import write_whole

GROWTH = 1.1  # results.csv is written again when there are so many times as many rows, so that it takes little time
Row = dict[str, Any]


@dataclass(slots=True)
class Outcome:
    """The numbers of all runs, unchanged, analysed and failed ones; a line for each report that was not written."""

    runs: int = 0
    unchanged: int = 0
    analysed: int = 0
    failed: int = 0
    unwritten: list[str] = field(default_factory=list)


def run_course(
    course: Plan,
    store: Store,
    folder: Path,
    *,
    jobs: int | None,
    dask: str | None,
    reports: int,
    progress: Callable[[Sequence[Row], int, int], None],
    reported: Callable[[int, int], None],
) -> Outcome:
    """Analyse the new and changed runs of a course, and write table, page and reports of all runs.

    ``progress`` is called with the rows just made, their number so far and their final number, ``reported`` with the
    numbers of finished and of all reports.
    """
    made_of = {job.key: job.made_of() for job in course.jobs}
    stored = store.made_of()
    todo = [job for job in course.jobs if stored.get(job.key) != made_of[job.key]]
    done = {job.key for job in course.jobs} - {job.key for job in todo}
    outcome = Outcome(len(course.jobs), len(done))
    written = len(done)
    for rows in _analysed(todo, jobs, dask):
        # A run during which a worker died is tried again by the next pass.
        store.add([(job.key, "" if row["status"] == "ended" else made_of[job.key], row) for job, row in rows])
        done |= {job.key for job, _ in rows}
        outcome.analysed += len(rows)
        if len(done) >= GROWTH * written:
            write_rows(folder, _table(course, store, done), course.tags)
            written = len(done)
        progress([row for _, row in rows], outcome.analysed, len(todo))
    table = _table(course, store, done)
    outcome.failed = sum(row["status"] in FAILED for row in table)
    write_rows(folder, table, course.tags)
    _write_pages(course, store, folder, table, outcome, reports, jobs, reported)
    return outcome


def _table(course: Plan, store: Store, done: set[str]) -> list[Row]:
    """Return the rows of the runs that have one, in the order of the runs, with their names and tags."""
    named = [pair for pair in zip(course.jobs, names_of(course.jobs), strict=True) if pair[0].key in done]
    rows = store.rows([job.key for job, _ in named])
    return [
        {**row, "run": name, COURSE: "", **{tag: job.tags.get(tag) for tag in course.tags}}
        for (job, name), row in zip(named, rows, strict=True)
    ]


def _analysed(todo: Sequence[Job], jobs: int | None, dask: str | None) -> Iterator[list[tuple[Job, Row]]]:
    """Yield jobs with their rows in batches; a run during which worker processes die gets a row stating this."""
    if not todo:
        return
    with workers(len(todo), jobs, dask) as by:
        for batch, rows in outcomes(analyse_many, todo, by):
            if rows is None:
                died = "its worker process died twice, for lack of memory perhaps; the next pass tries it again"
                rows = [blank_row(job, "ended", f"{job.path}: {died}") for job in batch]
            if any(row["code_sha256"] != code_sha256() for row in rows):
                wrong = "a worker has another version of springmass or of its libraries; install the same everywhere"
                raise ProgramError(f"{dask}: {wrong}", USAGE)
            yield list(zip(batch, rows, strict=True))


def _write_pages(
    course: Plan,
    store: Store,
    folder: Path,
    table: Sequence[Row],
    outcome: Outcome,
    reports: int,
    jobs: int | None,
    reported: Callable[[int, int], None],
) -> None:
    """Write what the groups should be told, the reports of the worst runs that are not up to date, and the page."""
    write_whole(folder / SHARED, report_script())
    lines = [line_of(row, course.tags) for row in table]
    if sum(row["status"] == "ok" for row in table) > 1:
        mark(lines, compare_rows(table))
    write_groups(folder, lines, course.tags)
    job_of = {row["run"]: job for row, job in zip(table, course.jobs, strict=True)}
    drawn = [line for row, line in zip(table, lines, strict=True) if row["status"] in ("ok", "no_oscillation")]
    chosen = heapq.nlargest(reports, drawn, key=lambda line: (line["need"], line["name"]))
    pages = {line["name"]: report_of(folder, line["name"]) for line in chosen}
    outcome.unwritten += remove_others(folder, set(pages.values()))
    fresh = store.reported()
    missing = {name: job_of[name] for name, page in pages.items() if job_of[name].key not in fresh or not page.exists()}
    reasons = write_missing(folder, missing, jobs, reported)
    store.set_reported(job.key for name, job in missing.items() if not reasons[name])
    outcome.unwritten += sorted(filter(None, reasons.values()))
    for line in chosen:
        if not reasons.get(line["name"]):
            line["link"] = pages[line["name"]].relative_to(folder).as_posix()
    write_page(folder, table, lines, course.tags)
