"""One pass over a course: what has to be done is done, and when all is there, tables and page are made of it."""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from springmass.batch.engines import by_dask, by_processes, here
from springmass.batch.page import PAGE, line_of, write_page
from springmass.batch.plan import Job, Plan, code_sha256, names_of, shard_of
from springmass.batch.reports import linked, need_of, worst, write_reports
from springmass.batch.results_table import CSV, PARQUET, write_tables
from springmass.batch.rows import FAILED, dumped, flat
from springmass.batch.store import Store
from springmass.batch.worker import unchanged
from springmass.errors import USAGE, ProgramError
from springmass.runs.processes import cores
from storage.atomic import writing
from storage.errors import WriteFailed

__all__ = ["LOG", "Options", "Outcome", "make", "run_pass"]

LOG = "batch.log"
FEW = 3  # runs, for which a second process would take longer to begin than to help


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """How a pass is made.

    Parameters
    ----------
    jobs : int or None
        Processes; None: one a core.
    shard : (int, int) or None
        Which of how many parts; None: all, and then the tables.
    dask : str or None
        Address of a scheduler.
    rehash : bool
        Whether files are read to see that they are unchanged.
    reports : int
        Full reports of so many of those that need a look most.
    """

    jobs: int | None = None
    shard: tuple[int, int] | None = None
    dask: str | None = None
    rehash: bool = False
    reports: int = 20


@dataclass(slots=True)
class Outcome:
    """What a pass did.

    Parameters
    ----------
    runs, kept, done : int
        In the pass, unchanged, analysed.
    failures : list of str
        One line a run that gave no period.
    unwritten : list of str
        One line a report, or the log, that could not be written.
    made : bool
        Whether tables and page were written, and not as they stand.
    """

    runs: int = 0
    kept: int = 0
    done: int = 0
    failures: list[str] = field(default_factory=list)
    unwritten: list[str] = field(default_factory=list)
    made: bool = False


def run_pass(
    plan: Plan,
    store: Store,
    folder: Path,
    options: Options,
    *,
    told: Callable[[Sequence[Mapping[str, Any]], int, int], None] | None = None,
) -> Outcome:
    """Do what is left of a course, and make tables and page where this pass is the whole of it.

    Parameters
    ----------
    plan : Plan
    store : Store
        Read.
    folder : Path
        For the results.
    options : Options
    told : callable, optional
        Of rows that were just made, how many there are by now and how many there will be.

    Raises
    ------
    storage.errors.WriteFailed
        If rows, tables or the page cannot be written. The rows that were written before stay.
    """
    jobs = shard_of(plan.jobs, options.shard)
    todo, touched = [], []
    outcome = Outcome(runs=len(jobs))
    for job in jobs:
        row, stamps = _kept(job, store, rehash=options.rehash)
        if row is None:
            todo.append(job)
            continue
        if row["stamps"] != stamps or row["job"] != job.told():
            touched.append({**row, "stamps": stamps, "job": job.told()})
        if row["status"] in FAILED:
            outcome.failures.append(row["error"])
    outcome.kept = len(jobs) - len(todo)
    if touched:
        store.add(touched)
    _log(folder, f"{_words(options)}: {len(jobs)} runs, {outcome.kept} unchanged", outcome)
    if todo:
        store.unmark()
    began = time.monotonic()
    for rows in _engine(todo, options):
        if any(row["code_sha256"] != code_sha256() for row in rows):
            demand = "one springmass with the same libraries was demanded, of workers and of this process, got another"
            raise ProgramError(f"{folder}: {demand}; start again, with the same versions everywhere", USAGE)
        store.add(rows)
        outcome.done += len(rows)
        outcome.failures += [row["error"] for row in rows if row["status"] in FAILED]
        if told is not None:
            told(rows, outcome.done, len(todo))
    _log(folder, f"{outcome.done} runs analysed in {time.monotonic() - began:.1f} s", outcome)
    if options.shard is None:
        make(plan, store, folder, outcome, reports=options.reports, jobs=options.jobs)
        _log(folder, "tables and page written" if outcome.made else "tables and page stand", outcome)
    return outcome


def _kept(job: Job, store: Store, *, rehash: bool) -> tuple[dict[str, Any] | None, list[list[Any]] | None]:
    """Return a run's row where one still holds, and the stamps of its files."""
    for row in store.rows(job.key):
        if (stamps := unchanged(job, row, rehash=rehash)) is not None:
            return row, stamps
    return None, None


def _engine(todo: Sequence[Job], options: Options) -> Iterator[list[dict[str, Any]]]:
    if not todo:
        return iter(())
    if options.dask is not None:
        return by_dask(todo, options.dask)
    processes = min(options.jobs or cores(), len(todo))
    return here(todo) if processes == 1 or len(todo) <= FEW else by_processes(todo, processes)


def make(plan: Plan, store: Store, folder: Path, outcome: Outcome, *, reports: int, jobs: int | None) -> None:
    """Make of the rows one file, the tables, the reports and the page, unless they stand already.

    The order is that of the paths, so that it does not matter in which order rows came. A report that cannot be
    written is missing on the page, and the next pass makes all of this again.
    """
    names = names_of(plan.jobs)
    made_of = {
        "jobs": hashlib.sha256(dumped([[job.told(), n] for job, n in zip(plan.jobs, names, strict=True)]).encode(
            "utf-8", "backslashreplace")).hexdigest(),
        "tags": list(plan.tags),
        "code": code_sha256(),
        "reports": reports,
        "program": _program_sha256(),
    }  # fmt: skip
    outputs = (CSV, PAGE, *((PARQUET,) if _parquet() else ()))
    if store.marked() == made_of and all((folder / name).is_file() for name in outputs):
        return
    store.unmark()

    def kept() -> Iterator[dict[str, Any]]:
        for job in plan.jobs:
            row, _ = _kept(job, store, rehash=False)
            # A file that changed while it was analysed, or whose process was ended: the next pass does it again.
            yield {**(row or next(store.rows(job.key))), "job": job.told()}

    needs, lines = [], []

    def rows() -> Iterator[dict[str, Any]]:
        for row, name in zip(store.put_together(kept()), names, strict=True):
            needs.append((need_of(row), name, row["status"]))
            lines.append(line_of(name, row, plan.tags))
            yield flat(row, name, plan.tags)

    write_tables(folder, rows(), plan.tags)
    chosen = worst(needs, reports)
    drawn = [(name, job) for name, job in zip(names, plan.jobs, strict=True) if name in chosen]
    failed = write_reports(folder, drawn, jobs)
    write_page(folder, lines, plan.tags, linked(folder) - failed.keys())
    if not failed:
        store.mark(made_of)
    outcome.unwritten += failed.values()
    outcome.made = True


def _parquet() -> bool:
    from importlib.util import find_spec

    return find_spec("pyarrow") is not None


def _program_sha256() -> str:
    """Digest of what tables and page are made by, beside what rows are."""
    here_ = Path(__file__).resolve().parent.parent / "report"
    files = sorted(file for file in here_.rglob("*") if file.suffix in (".py", ".j2", ".css"))
    return hashlib.sha256(b"\0".join(file.read_bytes() for file in files)).hexdigest()


def _words(options: Options) -> str:
    part = "all" if options.shard is None else "shard {}/{}".format(*options.shard)
    return f"{part}, process {os.getpid()}"


def _log(folder: Path, line: str, outcome: Outcome) -> None:
    """Append a line with the time of day to the log, the one file of a course that has such."""
    try:
        with writing(folder / LOG), (folder / LOG).open("a", encoding="utf-8") as log:
            log.write(f"{datetime.now(UTC).isoformat(timespec='seconds')} {line}\n")
    except WriteFailed as error:
        if str(error) not in outcome.unwritten:
            outcome.unwritten.append(str(error))
