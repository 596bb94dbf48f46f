"""Full reports of single runs of a course: of those that need a look most, and of any on demand."""

from __future__ import annotations

import hashlib
import heapq
import os
import re
import shutil
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from springmass.batch.plan import Job, job_of
from springmass.batch.store import Store
from springmass.errors import UNREADABLE, USAGE, ProgramError

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


def write_reports(folder: Path, chosen: Sequence[tuple[str, Job]], jobs: int | None) -> None:
    """Write the reports of these runs, take away those of others that an earlier pass wrote.

    A report that is there is written again: its run may have changed.
    """
    wanted = {report_name(run) for run, _ in chosen}
    for name in sorted(linked(folder) - wanted):
        shutil.rmtree(folder / REPORTS / name)
    if not chosen:
        return
    (folder / REPORTS).mkdir(exist_ok=True)
    tasks = [(run, job, folder / REPORTS / report_name(run)) for run, job in chosen]
    from springmass.runs.processes import cores, pool

    processes = min(jobs or cores(), len(tasks))
    if processes == 1:
        for task in tasks:
            write_one(*task)
        return
    with pool(processes) as workers:
        list(workers.map(write_one, *zip(*tasks, strict=True)))


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
        if run in (name, job.path) or os.path.abspath(run) == os.path.abspath(job.whole(job.path)):
            return name, job
    near = get_close_matches(run, names, n=1)
    hint = f"did you mean {near[0]}?" if near else f"it has {', '.join(list(names)[:5])} ..."
    raise ProgramError(f"{store.parts.parent}: a run of this course was demanded, got {run}; {hint}", USAGE)


def jobs_of(store: Store) -> list[Job]:
    """Return the jobs that the rows of a course were made of, seen from here."""
    here = os.getcwd()
    return [job_of(row["job"], here) for row in store.all()]
