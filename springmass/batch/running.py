"""One pass over a course: analyse what is new or has changed, then make tables, page and reports of all rows."""

from __future__ import annotations

import contextlib
import hashlib
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from springmass.batch.executors import Lost, dask_workers, local_workers, outcomes
from springmass.batch.page import line_of, write_page
from springmass.batch.plan import Job, Plan, code_sha256, names_of, plan
from springmass.batch.reports import linked, need_of, worst, write_reports
from springmass.batch.results_table import write_tables
from springmass.batch.rows import FAILED, dumped, flat
from springmass.batch.store import CSV, PAGE, PARQUET, Store
from springmass.batch.worker import analyse_many, blank_row, unchanged
from springmass.errors import USAGE, ProgramError
from springmass.runs.analysing import make_folder
from storage.atomic import writing
from storage.errors import WriteFailed

__all__ = ["LOG", "Outcome", "run_course"]

LOG = "batch.log"
Rows = Sequence[Mapping[str, Any]]


@dataclass(slots=True)
class Outcome:
    """What a pass did.

    Parameters
    ----------
    runs, unchanged, analysed : int
    failures : list of str
        One line a run without a period.
    unwritten : list of str
        One line a report, or the log, that could not be written.
    damaged : list of str
        One line a part of the results that was damaged; its runs were analysed again.
    edited : list of (str, str)
        Tables that somebody had edited, and the names under which they were kept.
    """

    runs: int = 0
    unchanged: int = 0
    analysed: int = 0
    failures: list[str] = field(default_factory=list)
    unwritten: list[str] = field(default_factory=list)
    damaged: list[str] = field(default_factory=list)
    edited: list[tuple[str, str]] = field(default_factory=list)


def run_course(
    inputs: Sequence[str],
    output: str,
    *,
    runs_csv: str | None = None,
    scene: str | None = None,
    accuracy: str = "standard",
    law: str | None = None,
    answers: Mapping[str, Any] | None = None,
    jobs: int | None = None,
    dask: str | None = None,
    rehash: bool = False,
    reports: int = 20,
    note: Callable[[str], None] = lambda _: None,
    progress: Callable[[Rows, int, int], None] = lambda *_: None,
    reported: Callable[[int, int], None] = lambda *_: None,
) -> Outcome:
    """Analyse the runs of a course that are new or have changed, and make tables, page and reports of all.

    Parameters
    ----------
    inputs, runs_csv, scene, accuracy, law, answers
        As :func:`springmass.batch.plan.plan` takes them.
    output : str
        Folder for the results; one that is there is continued.
    jobs : int, optional
        Processes; left out, one a core.
    dask : str, optional
        Address of a scheduler, whose workers analyse the runs.
    rehash : bool
        Whether every file is read to see whether it has changed.
    reports : int
        Number of runs, those that most need a look, that get a full report.
    note : callable
        Called with lines for the user, before the work begins.
    progress : callable
        Called with rows that were just made, how many there are by now, and how many there will be.
    reported : callable
        Called with how many reports are done, and of how many.

    Raises
    ------
    ProgramError
        With one line and exit code: for inputs that cannot be, a folder that another pass uses, no scheduler.
    storage.errors.WriteFailed
        If rows, tables or the page cannot be written. The rows that were written before stay.
    """
    folder = make_folder(output)
    store = Store(folder)
    with store.held():
        store.read()
        course = plan(
            inputs,
            runs_csv=runs_csv,
            scene=scene,
            accuracy=accuracy,
            law=law,
            answers=answers,
            known=store.paths(),
            but={os.path.abspath(folder)},
        )
        for line in course.notes:
            note(line)
        outcome = Outcome(runs=len(course.jobs), damaged=store.damaged)
        todo = _todo(course, store, outcome, rehash=rehash)
        _log(folder, f"process {os.getpid()}: {outcome.runs} runs, {outcome.unchanged} unchanged", outcome)
        began = time.monotonic()
        for rows in _analysed(todo, jobs, dask):
            store.add(rows)
            outcome.analysed += len(rows)
            outcome.failures += [row["error"] for row in rows if row["status"] in FAILED]
            progress(rows, outcome.analysed, len(todo))
        _log(folder, f"{outcome.analysed} runs analysed in {time.monotonic() - began:.1f} s", outcome)
        made = _make(course, store, outcome, reports=reports, jobs=jobs, reported=reported)
        _log(folder, "tables and page written" if made else "tables and page unchanged", outcome)
    outcome.edited = store.kept
    return outcome


def _todo(course: Plan, store: Store, outcome: Outcome, *, rehash: bool) -> list[Job]:
    """Return the jobs without a row that is up to date; count the others and note what changed but their content."""
    todo, touched = [], []
    for job in course.jobs:
        row, stamps = _kept(job, store, rehash=rehash)
        if row is None:
            todo.append(job)
            continue
        if row["stamps"] != stamps or row["job"] != job.to_mapping():
            touched.append({**row, "stamps": stamps, "job": job.to_mapping()})
        if row["status"] in FAILED:
            outcome.failures.append(row["error"])
    outcome.unchanged = len(course.jobs) - len(todo)
    if todo or touched:
        store.begin()
    if touched:
        store.add(touched)
    return todo


def _kept(job: Job, store: Store, *, rehash: bool) -> tuple[dict[str, Any] | None, list[list[Any]] | None]:
    """Return a run's row that is up to date, if there is one, and the stamps of its files."""
    for row in store.rows(job.key):
        if (stamps := unchanged(job, row, rehash=rehash)) is not None:
            return row, stamps
    return None, None


def _analysed(todo: Sequence[Job], jobs: int | None, dask: str | None) -> Iterator[list[dict[str, Any]]]:
    """Yield the rows of jobs, batch by batch. A run under which worker processes die is a row that says so."""
    if not todo:
        return
    with contextlib.ExitStack() as stack:
        workers = local_workers(len(todo), jobs) if dask is None else stack.enter_context(dask_workers(dask))
        for batch, rows in outcomes(analyse_many, todo, workers):
            if isinstance(rows, Lost):
                died = "its worker process died twice, for lack of memory perhaps; the next pass tries it again"
                rows = [blank_row(job, "ended", f"{job.path}: {died}") for job in batch]
            if any(row["code_sha256"] != code_sha256() for row in rows):
                wrong = "a worker has another version of springmass or of its libraries; install the same everywhere"
                raise ProgramError(f"{dask}: {wrong}", USAGE)
            yield rows


def _make(
    course: Plan,
    store: Store,
    outcome: Outcome,
    *,
    reports: int,
    jobs: int | None,
    reported: Callable[[int, int], None],
) -> bool:
    """Make parts in the order of the runs, tables, reports and page; return whether they had to be made.

    A report that cannot be written is missing on the page, and the next pass makes all of this again.
    """
    names = names_of(course.jobs)
    made_of = hashlib.sha256(
        dumped(
            {
                "jobs": [[job.to_mapping(), name] for job, name in zip(course.jobs, names, strict=True)],
                "tags": list(course.tags),
                "code": code_sha256(),
                "reports": reports,
                "program": _report_code_sha256(),
            }
        ).encode("utf-8", "backslashreplace")
    ).hexdigest()
    outputs = (CSV, PAGE, *((PARQUET,) if find_spec("pyarrow") is not None else ()))
    if store.is_complete(made_of) and all(map(store.is_intact, outputs)):
        return False
    store.begin()

    def kept() -> Iterator[dict[str, Any]]:
        for job, name in zip(course.jobs, names, strict=True):
            row, _ = _kept(job, store, rehash=False)
            # A file that changed while it was analysed, or whose worker died: the next pass analyses it again.
            yield {**(row or next(store.rows(job.key))), "job": job.to_mapping(), "run": name}

    needs, lines = [], []

    def rows() -> Iterator[dict[str, Any]]:
        for row in store.put_together(kept(), course.tags):
            needs.append((need_of(row), row["run"], row["status"]))
            lines.append(line_of(row, course.tags))
            yield flat(row, row["run"], course.tags)

    write_tables(store, rows(), course.tags)
    chosen = worst(needs, reports)
    drawn = [(name, job) for name, job in zip(names, course.jobs, strict=True) if name in chosen]
    failed = write_reports(store.folder, drawn, jobs, reported)
    write_page(store, lines, course.tags, linked(store.folder) - failed.keys())
    if not failed:
        store.complete(made_of)
    outcome.unwritten += failed.values()
    return True


def _report_code_sha256() -> str:
    """Digest of the code of the page and the reports, besides that of the rows."""
    folder = Path(__file__).resolve().parent.parent / "report"
    files = sorted(file for file in folder.rglob("*") if file.suffix in (".py", ".j2", ".css"))
    return hashlib.sha256(b"\0".join(file.read_bytes() for file in files)).hexdigest()


def _log(folder: Path, line: str, outcome: Outcome) -> None:
    """Append a line with the time of day to the log, the one file of a course with times of day."""
    try:
        with writing(folder / LOG), (folder / LOG).open("a", encoding="utf-8") as log:
            log.write(f"{datetime.now(UTC).isoformat(timespec='seconds')} {line}\n")
    except WriteFailed as error:
        if str(error) not in outcome.unwritten:
            outcome.unwritten.append(str(error))
