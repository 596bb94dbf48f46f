"""Full reports of single runs of a course: of those that need a look most, and of any on demand."""

from __future__ import annotations

import hashlib
import heapq
import os
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from pathlib import Path
from typing import Any

from acquisition.errors import visible
from springmass.batch.plan import Job, job_of
from springmass.batch.store import Store
from springmass.errors import UNREADABLE, USAGE, ProgramError, internal_error
from storage.atomic import writing
from storage.errors import WriteFailed, one_line

__all__ = ["REPORTS", "find_run", "jobs_of", "linked", "need_of", "report_name", "worst", "write_one", "write_reports"]

REPORTS = "reports"
TIME = "in batch.log"  # times of day stand in the log, so that a pass gives the same bytes whenever it is made


def need_of(row: Mapping[str, Any]) -> tuple[int, int, int, float]:
    """Return how much a run needs a look, the larger the more: failure, errors, warnings, misfit of its law."""
    status = {"ok": 0, "no_oscillation": 1}.get(row["status"], 2)
    misfit = row.get("reduced_chi2") or 0.0
    return status, row.get("errors") or 0, row.get("warnings") or 0, misfit


def worst(runs: Iterable[tuple[tuple[int, int, int, float], str, str]], count: int) -> set[str]:
    """Return the names of the runs that need a look most, of those of which there is something to draw.

    Of each run: how much it needs one, its name, its status.
    """
    drawn = ((need, name) for need, name, status in runs if status in ("ok", "no_oscillation"))
    return {name for _, name in heapq.nlargest(count, drawn)}


def report_name(run: str) -> str:
    """Return the folder of a run's report: its name, with what is no letter or digit told apart by a digest."""
    safe = re.sub(r"[^A-Za-z0-9.+_-]+", "_", run).strip("._")
    if safe == run and len(safe) <= 100:
        return f"{safe}.results"
    digest = hashlib.sha256(run.encode("utf-8", "backslashreplace")).hexdigest()[:8]
    return f"{safe[:100]}-{digest}.results"


def linked(folder: Path) -> set[str]:
    """Return the folders of reports that stand whole."""
    return {page.parent.name for page in (folder / REPORTS).glob("*.results/report.html")}


def write_reports(folder: Path, chosen: Sequence[tuple[str, Job]], jobs: int | None) -> dict[str, str]:
    """Write the reports of these runs, take away those of others that an earlier pass wrote.

    A report that is there is written again: its run may have changed.

    Returns
    -------
    dict of str to str
        By the name of its folder, why a report could not be written or taken away; the others stand.
    """
    tasks = [(run, job, folder / REPORTS / report_name(run)) for run, job in chosen]
    failed: dict[str, str] = {}
    for name in sorted(linked(folder) - {place.name for _, _, place in tasks}):
        try:
            with writing(folder / REPORTS / name):
                shutil.rmtree(folder / REPORTS / name)
        except WriteFailed as error:
            failed[name] = str(error)
    from springmass.runs.processes import cores, pool

    processes = min(jobs or cores(), len(tasks))
    if processes <= 1:
        outcomes: list[str | None] = [_attempt(*task) for task in tasks]
    else:
        with pool(processes) as workers:
            outcomes = list(_each(workers, tasks))
    for (run, job, place), outcome in zip(tasks, outcomes, strict=True):
        # A process that ends takes the whole pool with it: this report gets a process of its own.
        if outcome is None:
            with pool(1) as worker:
                (outcome,) = _each(worker, [(run, job, place)])
        if outcome is None:
            outcome = f"{place}: its process was ended from outside, for lack of memory perhaps; run batch again"
        if outcome:
            failed[place.name] = outcome
    return failed


def _each(workers: ProcessPoolExecutor, tasks: Sequence[tuple[str, Job, Path]]) -> Iterator[str | None]:
    """Yield of each task why it failed, empty where it did not, and None where its process ended."""
    futures: list[Future[str] | None] = []
    for task in tasks:
        try:
            futures.append(workers.submit(_attempt, *task))
        except BrokenProcessPool:
            futures.append(None)
    for future in futures:
        try:
            yield None if future is None else future.result()
        except BrokenProcessPool:
            yield None


def _attempt(run: str, job: Job, folder: Path) -> str:
    """Write the report of a run; return in one line why it cannot be written, or nothing."""
    try:
        write_one(run, job, folder)
    except (ProgramError, WriteFailed) as error:
        return str(error)
    except OSError as error:
        return f"{folder}: no report could be written ({one_line(error)}); run batch again"
    except MemoryError:
        return f"{folder}: more memory was demanded than there is; end other programs, or use fewer processes"
    except Exception as error:  # a defect costs this report, and not those of the other runs
        return f"{folder}: {internal_error(error)}"
    return ""


def write_one(run: str, job: Job, folder: Path) -> Path:
    """Write the report of a run; return its page.

    Raises
    ------
    ProgramError
        With exit code 3 if its recording cannot be analysed.
    """
    from acquisition.errors import AcquisitionError
    from pipeline.errors import PipelineError
    from springmass.batch.worker import load_job
    from springmass.errors import hushed
    from springmass.report.write import write_report
    from springmass.runs.analysing import analyse_loaded
    from storage.errors import StorageError

    try:
        with hushed():
            loaded, given = load_job(job)
        analysed = analyse_loaded(
            loaded,
            given,
            parameters={**job.answers, "accuracy": job.accuracy},
            name=run,
            accuracy=job.accuracy,
            time_utc=TIME,
        )
    except (AcquisitionError, StorageError, PipelineError) as error:
        raise ProgramError(str(error), UNREADABLE) from error
    result = {**analysed.result, "input": {**analysed.result["input"], "path": job.path}}
    return write_report(folder, [replace(analysed, result=result)])


def find_run(store: Store, names: Mapping[str, Job], run: str) -> tuple[str, Job]:
    """Return the name and the job of the run that somebody asks for, by its name or its path.

    Raises
    ------
    ProgramError
        With exit code 2 if there is none.
    """
    from difflib import get_close_matches

    for name, job in names.items():
        # The table shows a name with its control characters as escapes, and so it may come back.
        if run in (name, job.path, visible(name)) or os.path.abspath(run) == os.path.abspath(job.whole(job.path)):
            return name, job
    near = get_close_matches(run, names, n=1)
    hint = f"did you mean {near[0]}?" if near else f"it has {', '.join(list(names)[:5])} ..."
    raise ProgramError(f"{store.parts.parent}: a run of this course was demanded, got {run}; {hint}", USAGE)


def jobs_of(store: Store) -> list[Job]:
    """Return the jobs that the rows of a course were made of, seen from here."""
    here = os.getcwd()
    return [job_of(row["job"], here) for row in store.all()]
