"""Make one pass over a course: analyse new and changed runs, then write table, page and reports of all rows."""

import hashlib
import heapq
from collections.abc import Collection, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from springmass.charts.browser import report_script
from springmass.course.benches import compare_rows
from springmass.course.executors import outcomes, workers
from springmass.course.page import line_of, mark, write_groups, write_page
from springmass.course.plan import Plan, key_of, made_of, names_of, software
from springmass.course.results_csv import COURSE, FAILED, write_results
from springmass.course.store import Store
from springmass.course.worker import Remedy, analyse_one, blank_row, write_report_of
from springmass.errors import LOG, ProgramError
from springmass.report.html import SHARED
from springmass.result.output_names import safe_name
from springmass.runs.tasks import Task
from springmass.terminal.progress import counting
from storage.atomic import write_whole

ROWS_RATIO = 1.1  # results.csv is written again when there are so many times as many rows, so that it takes little time
REPORTS = "reports"
_DIED = "its worker process died twice, for lack of memory perhaps; the next pass tries it again"
CourseRow = dict[str, Any]


def run_course(
    course: Plan, store: Store, folder: Path, *, jobs: int | None, dask: str | None, reports: int, remedy: Remedy
) -> tuple[list[CourseRow], int, list[str]]:
    """Analyse the new and changed runs of a course, and write table, page and reports of all runs.

    ``remedy`` words how to answer what a recording leaves open. Runs that fail are reported as they do. Return all
    rows, how many were made, and a line for each unwritten report.
    """
    now = {key_of(task): made_of(task) for task in course.tasks}
    stored = store.made_of()
    todo = [task for task in course.tasks if stored.get(key_of(task)) != now[key_of(task)]]
    names = dict(zip(now, names_of(course.tasks), strict=True))
    done = now.keys() - set(map(key_of, todo))
    if todo:  # an interrupted pass leaves no report of a run that has changed, and the next none but those of the worst
        _remove_reports(folder, keep={_report_of(names[key], key) for key in done})
    made, written = 0, len(done)
    with counting("runs", len(todo), lines=True) as show:
        for rows in _analysed(todo, jobs, dask, remedy):
            # A run during which a worker died is tried again by the next pass.
            store.add((key, "" if row["status"] == "ended" else now[key], row) for key, row in rows)
            done |= {key for key, _ in rows}
            made += len(rows)
            if len(done) >= ROWS_RATIO * written:
                write_results(folder, _table(course, store, done), course.tags)
                written = len(done)
            for _, row in rows:
                if row["status"] in FAILED:
                    LOG.warning(row["error"])
            show(made)
    table = _table(course, store, done)
    write_results(folder, table, course.tags)
    return table, made, _write_pages(course, folder, table, reports, jobs, remedy, anew=bool(todo))


def _remove_reports(folder: Path, keep: Collection[str]) -> None:
    """Remove all reports but those, given by their paths in the folder."""
    from springmass.report.write import remove_report

    for page in (folder / REPORTS).glob("*.results/report.html"):
        if page.relative_to(folder).as_posix() not in keep:
            remove_report(page.parent)


def _table(course: Plan, store: Store, done: set[str]) -> list[CourseRow]:
    """Return the rows of the runs that have one, in the order of the runs, with their names and tags."""
    runs = zip(map(key_of, course.tasks), names_of(course.tasks), course.tagged, strict=True)
    named = [run for run in runs if run[0] in done]
    rows = store.rows([key for key, _, _ in named])
    return [
        {**row, "run": name, COURSE: "", **{tag: tags.get(tag) for tag in course.tags}}
        for (_, name, tags), row in zip(named, rows, strict=True)
    ]


def _analysed(
    todo: Sequence[Task], jobs: int | None, dask: str | None, remedy: Remedy
) -> Iterator[list[tuple[str, CourseRow]]]:
    """Yield keys with their rows; a run during which worker processes die gets a row stating this."""
    if not todo:
        return
    with workers(len(todo), jobs, dask) as by:
        for done in outcomes(partial(analyse_one, remedy=remedy), todo, by):
            rows = [(key_of(task), row or blank_row(task, "ended", f"{task.name}: {_DIED}")) for task, row in done]
            if any(row["software"] != software() for _, row in rows):
                wrong = f"{dask or 'this machine'}: a worker has another version of springmass or of its libraries"
                raise ProgramError(wrong, "install the same everywhere")
            yield rows


def _write_pages(
    course: Plan,
    folder: Path,
    table: Sequence[CourseRow],
    reports: int,
    jobs: int | None,
    remedy: Remedy,
    *,
    anew: bool,
) -> list[str]:
    """Write what to tell the groups, missing reports of the worst runs, and the page; return what cannot be written.

    If rows were made ``anew``, reports of runs that are no longer among the worst are removed.
    """
    write_whole(folder / SHARED, report_script())
    lines = [line_of(row, course.tags) for row in table]
    comparison = compare_rows(table) if sum(row["status"] == "ok" for row in table) > 1 else None
    if comparison is not None:
        mark(lines, comparison)
    write_groups(folder, lines, course.tags)
    for line, task in zip(lines, course.tasks, strict=True):
        line["link"] = _report_of(line["name"], key_of(task))
    drawn = [(line, task) for line, task in zip(lines, course.tasks, strict=True) if line["need"][0] < 2]
    worst = heapq.nlargest(reports, drawn, key=lambda pair: (pair[0]["need"], pair[0]["name"]))
    named = [(line["name"], task, folder / line["link"]) for line, task in worst]
    if anew:
        _remove_reports(folder, keep={line["link"] for line, _ in worst})
    todo = [(name, task, page.parent) for name, task, page in named if not page.exists()]
    unwritten: list[str] = []
    finished = 0
    progress = counting("reports", len(todo), lines=True)
    with workers(len(todo), jobs) as by, progress as show:
        for written in outcomes(partial(write_report_of, remedy=remedy), todo, by):
            unwritten += [f"{task.name}: {_DIED}" if why is None else why for (_, task, _), why in written if why != ""]
            finished += len(written)
            show(finished)
    for line in lines:
        line["link"] = line["link"] if (folder / line["link"]).exists() else ""
    write_page(folder, table, lines, course.tags, comparison)
    return sorted(unwritten)


def _report_of(name: str, key: str) -> str:
    """Return the path of a run's report in the folder; names are numbered anew if a run is removed, keys are not."""
    safe = safe_name(name, longest=100)
    return f"{REPORTS}/{safe}-{hashlib.sha256(key.encode()).hexdigest()[:8]}.results/report.html"
