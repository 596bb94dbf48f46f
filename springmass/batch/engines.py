"""Who does the work: this process, processes of this machine, or those of a dask cluster."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Future, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from springmass.batch.plan import Job
from springmass.batch.worker import analyse_many, blank_row
from springmass.errors import SOME_FAILED, USAGE, ProgramError
from springmass.runs.processes import pool

__all__ = ["by_dask", "by_processes", "here"]

Rows = list[dict[str, Any]]
CHUNK = 32  # runs of a part: what a kill costs at most, a process
DASK_CHUNK = 100  # a task of fewer costs more to hand out than to do
TRIES = 3  # of a run whose process ends under it
AHEAD = 2  # chunks a process that wait for it


def chunks(jobs: Sequence[Job], processes: int) -> list[list[Job]]:
    """Cut jobs into chunks, smaller toward the end, so that no process waits long for the last."""
    cut, at = [], 0
    while at < len(jobs):
        size = max(1, min(CHUNK, (len(jobs) - at) // (4 * processes)))
        cut.append(list(jobs[at : at + size]))
        at += size
    return cut


def here(jobs: Sequence[Job]) -> Iterator[Rows]:
    """Yield the rows of jobs done in this process."""
    yield from (analyse_many(jobs[at : at + CHUNK]) for at in range(0, len(jobs), CHUNK))


def by_processes(jobs: Sequence[Job], processes: int) -> Iterator[Rows]:
    """Yield the rows of jobs as processes of this machine finish them.

    A process that is ended from outside costs its chunk, which another does again. A run under which processes end
    again and again is found by itself, and gets a row that says so.
    """
    waiting = [(chunk, 0) for chunk in chunks(jobs, processes)]
    while waiting:
        left: list[tuple[list[Job], int]] = []
        yield from _one_pool([(c, n) for c, n in waiting if n < TRIES], processes, left)
        for chunk in [c for c, n in waiting if n >= TRIES]:
            for job in chunk:
                yield from _alone(job)
        waiting = left


def _one_pool(
    waiting: Sequence[tuple[list[Job], int]], processes: int, left: list[tuple[list[Job], int]]
) -> Iterator[Rows]:
    """Yield what a pool finishes; put into ``left`` what it does not, with how often it was begun."""
    if not waiting:
        return
    todo = list(reversed(waiting))
    running: dict[Future[Rows], tuple[list[Job], int]] = {}
    with pool(min(processes, len(todo))) as workers:
        try:
            while todo or running:
                while todo and len(running) < AHEAD * processes:
                    chunk, tries = todo.pop()
                    try:
                        running[workers.submit(analyse_many, chunk)] = (chunk, tries + 1)
                    except BrokenProcessPool:
                        left.append((chunk, tries))
                        left += reversed(todo)
                        todo.clear()
                for future in wait(running, return_when="FIRST_COMPLETED").done:
                    chunk, tries = running.pop(future)
                    try:
                        rows = future.result()
                    except BrokenProcessPool:
                        left.append((chunk, tries))
                    else:
                        yield rows
        except BaseException:
            workers.shutdown(wait=False, cancel_futures=True)
            raise


def _alone(job: Job) -> Iterator[Rows]:
    """Yield the row of a job in a process of its own."""
    with pool(1) as worker:
        try:
            yield worker.submit(analyse_many, [job]).result()
        except BrokenProcessPool:
            told = f"{job.path}: its process was ended from outside {TRIES + 1} times, for lack of memory perhaps"
            yield [blank_row(job, "ended", f"{told}; the next pass tries it again")]


def by_dask(jobs: Sequence[Job], address: str) -> Iterator[Rows]:
    """Yield the rows of jobs as the workers of a dask cluster finish them, a hundred runs a task.

    The workers read the inputs by the same paths as this process. A task whose worker ends is done by another.

    Raises
    ------
    ProgramError
        With exit code 2 without dask or a scheduler at the address, 1 if a task failed on every worker that took it.
    """
    try:
        import distributed
    except ImportError as error:
        raise ProgramError(
            "--dask needs dask.distributed, which is not installed; pip install 'springmass[dask]'", USAGE
        ) from error
    try:
        connect: Any = distributed.Client
        client = connect(address, set_as_default=False, timeout=20)
    except (OSError, ValueError, TimeoutError) as error:
        told = " ".join(str(error).split())
        raise ProgramError(
            f"{address}: a dask scheduler was demanded, none answers ({told}); start dask scheduler", USAGE
        ) from error
    with client:
        tasks = [list(jobs[at : at + DASK_CHUNK]) for at in range(0, len(jobs), DASK_CHUNK)]
        futures = [client.submit(analyse_many, task, pure=False, retries=TRIES) for task in tasks]
        of = {future.key: task for future, task in zip(futures, tasks, strict=True)}
        waited: Any = distributed.as_completed
        for future in waited(futures, loop=client.loop):
            if future.status != "finished":
                wrong = future.exception()
                told = f"{type(wrong).__name__}: {' '.join(str(wrong).split())}"
                first = of[future.key][0].path
                raise ProgramError(
                    f"{address}: a task of runs from {first} on failed ({told}); what is done stays done", SOME_FAILED
                )
            rows: Rows = future.result()
            future.release()
            yield rows
