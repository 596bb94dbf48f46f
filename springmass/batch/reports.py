"""Write full reports of the runs of a course that most need inspection."""

from __future__ import annotations

import hashlib
import re
import shutil
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from springmass.batch.executors import outcomes, workers
from springmass.batch.plan import Job
from springmass.batch.worker import write_reports
from storage.atomic import writing
from storage.errors import WriteFailed

REPORTS = "reports"


class Need(NamedTuple):
    """How much a run needs inspection; it sorts by its fields, and larger is more urgent."""

    status: int  # 0 with an oscillation, 1 without, 2 for a file that failed
    errors: int
    harmful: int  # findings that change a result
    misfit: float


def need_of(row: Mapping[str, Any]) -> Need:
    """Return how much a run needs inspection."""
    status = {"ok": 0, "no_oscillation": 1}.get(row["status"], 2)
    return Need(status, row["errors"], len(row["tell"]), row.get("reduced_chi2") or 0.0)


def report_of(folder: Path, run: str) -> Path:
    """Return the page of a run's report; its folder has a digest if the name is long or has unsafe characters."""
    safe = re.sub(r"[^A-Za-z0-9.+_-]+", "_", run).strip("._")
    if safe != run or len(safe) > 100:
        safe = f"{safe[:100]}-{hashlib.sha256(run.encode('utf-8', 'backslashreplace')).hexdigest()[:8]}"
    return folder / REPORTS / f"{safe}.results" / "report.html"


def remove_others(folder: Path, pages: set[Path]) -> Iterator[str]:
    """Remove the reports of runs that are not among the chosen ones; yield a line for each that stays."""
    for page in sorted(set((folder / REPORTS).glob("*.results/report.html")) - pages):
        try:
            with writing(page.parent):
                shutil.rmtree(page.parent)
        except WriteFailed as error:
            yield str(error)


def write_missing(
    folder: Path, missing: Mapping[str, Job], jobs: int | None, progress: Callable[[int, int], None]
) -> dict[str, str]:
    """Write reports of runs by processes of this machine; return by name why one could not be written, or nothing."""
    tasks = [(run, job, report_of(folder, run).parent) for run, job in missing.items()]
    reasons: dict[str, str] = {}
    with workers(len(tasks), jobs) as by:
        for batch, failures in outcomes(write_reports, tasks, by, 1):
            for run, job, _ in batch:
                reasons[run] = f"{job.path}: its worker process died twice, perhaps for lack of memory; run batch again"
            reasons |= {} if failures is None else {task[0]: why for task, why in zip(batch, failures, strict=True)}
            progress(len(reasons), len(tasks))
    return reasons
