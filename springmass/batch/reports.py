"""Write full reports of single runs of a course: those that most need inspection, and any run on request."""

from __future__ import annotations

import hashlib
import heapq
import os
import re
import shutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from acquisition.errors import visible
from springmass.batch.executors import Lost, local_workers, outcomes
from springmass.batch.plan import Job
from springmass.errors import NO_MEMORY, UNREADABLE, USAGE, ProgramError, internal_error
from springmass.report.script import SHARED
from storage.atomic import write_whole, writing
from storage.errors import WriteFailed, one_line

__all__ = ["REPORTS", "find_run", "linked", "need_of", "report_name", "worst", "write_one", "write_reports"]

REPORTS = "reports"
TIME = "in batch.log"  # fixed text in place of a time, so that a pass at any time gives the same bytes


class Need(NamedTuple):
    """How much a run needs inspection; it sorts by its fields, and larger is more urgent."""

    status: int  # 0 with an oscillation, 1 without, 2 for a file that failed
    errors: int
    harmful: int  # findings that change a result
    misfit: float


def need_of(row: Mapping[str, Any]) -> Need:
    """Return how much a run needs inspection."""
    status = {"ok": 0, "no_oscillation": 1}.get(row["status"], 2)
    return Need(status, row.get("errors") or 0, len(row.get("tell") or ()), row.get("reduced_chi2") or 0.0)


def worst(runs: Iterable[tuple[Need, str, str]], count: int) -> set[str]:
    """Return the names of the runs that most need inspection, among those that can be drawn.

    Each run consists of its need from :func:`need_of`, its name and its status.
    """
    drawn = ((need, name) for need, name, status in runs if status in ("ok", "no_oscillation"))
    return {name for _, name in heapq.nlargest(count, drawn)}


def report_name(run: str) -> str:
    """Return the folder of a run's report: the run's name, with a digest if it is long or has unsafe characters."""
    safe = re.sub(r"[^A-Za-z0-9.+_-]+", "_", run).strip("._")
    if safe == run and len(safe) <= 100:
        return f"{safe}.results"
    digest = hashlib.sha256(run.encode("utf-8", "backslashreplace")).hexdigest()[:8]
    return f"{safe[:100]}-{digest}.results"


def linked(folder: Path) -> set[str]:
    """Return the names of existing report folders."""
    return {page.parent.name for page in (folder / REPORTS).glob("*.results/report.html")}


def write_reports(
    folder: Path,
    chosen: Sequence[tuple[str, Job]],
    jobs: int | None,
    progress: Callable[[int, int], None] = lambda *_: None,
) -> dict[str, str]:
    """Write the reports of the chosen runs, and remove earlier reports of other runs.

    An existing report is written again, because its run may have changed.

    Parameters
    ----------
    folder : Path
        Folder of the course.
    chosen : sequence of (str, Job)
        Names and jobs of the chosen runs.
    jobs : int or None
        Number of processes; None: one per core.
    progress : callable
        Called with the number of finished reports and their total number.

    Returns
    -------
    dict of str to str
        Reasons why reports could not be written or removed, by the name of the report's folder.
    """
    tasks = [(run, job, folder / REPORTS / report_name(run)) for run, job in chosen]
    failed: dict[str, str] = {}
    try:
        write_script(folder)
    except WriteFailed as error:
        failed[SHARED] = str(error)
    for name in sorted(linked(folder) - {place.name for _, _, place in tasks}):
        try:
            with writing(folder / REPORTS / name):
                shutil.rmtree(folder / REPORTS / name)
        except WriteFailed as error:
            failed[name] = str(error)
    done = 0
    for batch, reasons in outcomes(_attempts, tasks, local_workers(len(tasks), jobs), batch=1):
        for (_, _, place), reason in zip(batch, [_DIED] if isinstance(reasons, Lost) else reasons, strict=True):
            if reason:
                failed[place.name] = f"{place}: {reason}"
        done += len(batch)
        progress(done, len(tasks))
    return dict(sorted(failed.items()))


_Task = tuple[str, Job, Path]
_DIED = "its worker process died twice, perhaps for lack of memory; run batch again"


def _attempts(tasks: Sequence[_Task]) -> list[str]:
    return [_attempt(*task) for task in tasks]


def _attempt(run: str, job: Job, folder: Path) -> str:
    """Write the report of a run; return a one-line reason if it cannot be written, or an empty string."""
    try:
        write_one(run, job, folder)
    except (ProgramError, WriteFailed) as error:
        return str(error)
    except OSError as error:
        return f"no report could be written ({one_line(error)}); run batch again"
    except MemoryError:
        return NO_MEMORY
    except Exception as error:  # a defect in the program must not stop the reports of other runs
        return internal_error(error)
    return ""


def write_one(run: str, job: Job, folder: Path) -> Path:
    """Write the report of a run, and return the path of its page.

    Raises
    ------
    ProgramError
        With exit code 3 if the recording cannot be analysed.
    """
    from acquisition.errors import AcquisitionError
    from pipeline.errors import PipelineError
    from springmass.batch.worker import analyse_job
    from springmass.errors import quietly
    from springmass.report.write import write_report
    from storage.errors import StorageError

    try:
        with quietly():
            analysed = replace(analyse_job(job), name=run, time_utc=TIME)
    except (AcquisitionError, StorageError, PipelineError) as error:
        raise ProgramError(str(error), UNREADABLE) from error
    result = {**analysed.result, "input": {**analysed.result["input"], "path": job.path}}
    return write_report(folder, [replace(analysed, result=result)], script=f"../../{SHARED}")


def write_script(folder: Path) -> None:
    """Write the script that the course's page and all its reports share."""
    from springmass.report.script import report_script

    write_whole(folder / SHARED, report_script())


def find_run(folder: Path, jobs: Mapping[str, Job], run: str) -> tuple[str, Job]:
    """Return the name and the job of a run, which is identified by its name or its path.

    Parameters
    ----------
    folder : Path
        Folder of the course.
    jobs : mapping
        Jobs by the name of the run.
    run : str
        Name or path of the run.

    Raises
    ------
    ProgramError
        With exit code 2 if the course has no such run.
    """
    from difflib import get_close_matches

    for name, job in jobs.items():
        # The table shows control characters as escapes, and a user may copy a name from it.
        if run in (name, job.path, visible(name)) or os.path.abspath(run) == os.path.abspath(job.whole(job.path)):
            return name, job
    near = get_close_matches(run, jobs, n=1)
    hint = f"did you mean {near[0]}?" if near else f"it has {', '.join(list(jobs)[:5])} ..."
    raise ProgramError(f"{folder}: this course has no run {run}; {hint}", USAGE)
