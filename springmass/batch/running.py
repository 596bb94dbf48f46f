"""Make one pass over a course: analyse new and changed runs, then write tables, page and reports of all rows."""

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

from springmass.batch.benches import NEEDED, compare_rows
from springmass.batch.executors import Lost, dask_workers, local_workers, outcomes
from springmass.batch.page import line_of, mark, write_groups, write_page
from springmass.batch.plan import Job, Plan, code_sha256, names_of, plan
from springmass.batch.reports import linked, worst, write_reports
from springmass.batch.results_table import write_tables
from springmass.batch.rows import COURSE, FAILED, dumped, flat
from springmass.batch.store import CSV, GROUPS, PAGE, PARQUET, Store
from springmass.batch.worker import analyse_many, blank_row, unchanged
from springmass.errors import USAGE, ProgramError
from springmass.report.script import SHARED
from springmass.runs.outputs import make_folder
from storage.atomic import writing
from storage.errors import WriteFailed

__all__ = ["LOG", "Outcome", "run_course"]

LOG = "batch.log"
Rows = Sequence[Mapping[str, Any]]


@dataclass(slots=True)
class Outcome:
    """The outcome of a pass.

    Parameters
    ----------
    runs, unchanged, analysed : int
        Numbers of all runs, of unchanged runs and of analysed runs.
    failures : list of str
        One line for each run without a period.
    unwritten : list of str
        One line for each report, or the log, that could not be written.
    damaged : list of str
        One line for each damaged part of the results; its runs were analysed again.
    edited : list of (str, str)
        Tables or page edited by the user, with the names under which they were kept.
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
    """Analyse the new and changed runs of a course, and write tables, page and reports of all runs.

    Parameters
    ----------
    inputs, runs_csv, scene, accuracy, law, answers
        As in :func:`springmass.batch.plan.plan`.
    output : str
        Folder for the results; the course in an existing folder is continued.
    jobs : int, optional
        Number of processes; if omitted, one per core.
    dask : str, optional
        Address of a scheduler, whose workers analyse the runs.
    rehash : bool
        Whether every file is read to check whether it has changed.
    reports : int
        Number of runs with a full report; those that most need inspection are chosen.
    note : callable
        Called with each line for the user before the work begins.
    progress : callable
        Called with the rows just made, the number of rows made so far, and their final number.
    reported : callable
        Called with the number of finished reports and their final number.

    Raises
    ------
    ProgramError
        If an input is invalid, another pass is using the folder, or no scheduler answers.
    storage.errors.WriteFailed
        If rows, tables or the page cannot be written. Rows already written are kept.
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
    """Return the jobs without an up-to-date row; count the others, and store new stamps and jobs of unchanged runs."""
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
    """Return a run's up-to-date row, if there is one, and the stamps of its files."""
    for row in store.rows(job.key):
        if (stamps := unchanged(job, row, rehash=rehash)) is not None:
            return row, stamps
    return None, None


def _analysed(todo: Sequence[Job], jobs: int | None, dask: str | None) -> Iterator[list[dict[str, Any]]]:
    """Yield the rows of jobs in batches; a run during which worker processes die gets a row stating this."""
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
    """Write parts in the order of the runs, tables, reports and page; return whether this was necessary.

    A report that cannot be written is missing from the page, and the next pass repeats this whole step.
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
    outputs = (CSV, GROUPS, PAGE, *((PARQUET,) if find_spec("pyarrow") is not None else ()))
    if store.is_complete(made_of) and all(map(store.is_intact, outputs)) and (store.folder / SHARED).exists():
        return False
    store.begin()

    def kept() -> Iterator[dict[str, Any]]:
        for job, name in zip(course.jobs, names, strict=True):
            row, _ = _kept(job, store, rehash=False)
            # Without an up-to-date row, a file changed during the analysis or a worker died; the next pass repeats it.
            yield {**(row or next(store.rows(job.key))), "job": job.to_mapping(), "run": name}

    statuses, lines, compared = [], [], []
    columns = (*(name for name in NEEDED if name != COURSE), *course.tags)

    def rows() -> Iterator[dict[str, Any]]:
        for row in store.put_together(kept(), course.tags):
            statuses.append(row["status"])
            lines.append(line_of(row, course.tags))
            cells = flat(row, row["run"], course.tags)
            compared.append({**{name: cells[name] for name in columns}, COURSE: "", "run": row["run"]})
            yield cells

    write_tables(store, rows(), course.tags)
    if statuses.count("ok") > 1:
        mark(lines, compare_rows(compared))
    write_groups(store, lines, course.tags)
    needs = [(line["need"], line["name"], status) for line, status in zip(lines, statuses, strict=True)]
    chosen = worst(needs, reports)
    drawn = [(name, job) for name, job in zip(names, course.jobs, strict=True) if name in chosen]
    failed = write_reports(store.folder, drawn, jobs, reported)
    write_page(store, lines, course.tags, linked(store.folder) - failed.keys())
    if not failed:
        store.complete(made_of)
    outcome.unwritten += failed.values()
    return True


def _report_code_sha256() -> str:
    """Return the digest of the code for page and reports, which is separate from the code for rows."""
    home = Path(__file__).resolve().parent.parent
    every = [file for name in ("report", "charts", "page/static") for file in (home / name).rglob("*")]
    files = sorted(file for file in every if file.suffix in (".py", ".j2", ".css", ".js"))
    return hashlib.sha256(b"\0".join(file.read_bytes() for file in files)).hexdigest()


def _log(folder: Path, line: str, outcome: Outcome) -> None:
    """Append a line with the time of day to the log, which is the only file of a course with times of day."""
    try:
        with writing(folder / LOG), (folder / LOG).open("a", encoding="utf-8") as log:
            log.write(f"{datetime.now(UTC).isoformat(timespec='seconds')} {line}\n")
    except WriteFailed as error:
        if str(error) not in outcome.unwritten:
            outcome.unwritten.append(str(error))
