"""Run tasks in this process, in processes of this machine, or on a dask cluster, with one loop for all of them."""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import AbstractContextManager
from dataclasses import dataclass
from multiprocessing import active_children
from typing import Any, TypeVar

from springmass.errors import SOME_FAILED, USAGE, ProgramError
from springmass.runs.processes import cores, pool

__all__ = ["BATCH", "LOST", "Lost", "Workers", "dask_workers", "local_workers", "outcomes"]

Task = TypeVar("Task")
Result = TypeVar("Result")
BATCH = 100  # maximum tasks per batch; to hand out a single run, dask takes three times as long as its analysis
AHEAD = 2  # batches handed out per worker, so that no worker waits for its next batch
FEW = 3  # up to this many tasks, starting a second process takes longer than it saves


class Lost:
    """Placeholder for the result of a task whose worker died."""


LOST = Lost()


@dataclass(frozen=True, slots=True)
class Workers:
    """The workers that do the tasks.

    Parameters
    ----------
    start : callable
        Returns a context manager for an executor; called again for a new one after a worker has died.
    count : int or None
        Number of tasks done at the same time; None if workers come and go.
    died : tuple of type
        Exceptions that a future raises if the worker of its task died.
    address : str
        Address of the scheduler; empty if all work is done on this machine.
    """

    start: Callable[[], AbstractContextManager[Executor]]
    count: int | None
    died: tuple[type[BaseException], ...] = (BrokenExecutor,)
    address: str = ""


class _ThisProcess(Executor):
    """Executor that does each task as soon as it is submitted."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


def local_workers(tasks: int, processes: int | None = None) -> Workers:
    """Return processes of this machine, by default one per core; for a few tasks, return only this process."""
    number = min(processes or cores(), tasks)
    if number <= 1 or tasks <= FEW:
        return Workers(_ThisProcess, 1)
    return Workers(lambda: _pool(number), number)


@contextlib.contextmanager
def _pool(processes: int) -> Iterator[Executor]:
    """Yield a pool whose processes are terminated on an error or Ctrl-C, because a batch may take minutes."""
    others = set(active_children())
    with pool(processes) as executor:
        try:
            yield executor
        except BaseException:
            for process in set(active_children()) - others:
                process.terminate()
            raise


@contextlib.contextmanager
def dask_workers(address: str) -> Iterator[Workers]:
    """Yield the workers of a dask cluster, which must find the inputs at the same paths as this process.

    Raises
    ------
    ProgramError
        With exit code 2 if dask is not installed or no scheduler answers at the address.
    """
    try:
        from distributed import Client, KilledWorker
    except ImportError as error:
        raise ProgramError("--dask needs dask.distributed; pip install 'springmass[dask]'", USAGE) from error
    connect: Any = Client
    try:
        client = connect(address, set_as_default=False, timeout=20)
    except (OSError, ValueError, TimeoutError) as error:
        reason = " ".join(str(error).split())
        raise ProgramError(f"{address}: no dask scheduler answers ({reason}); start dask scheduler", USAGE) from error

    @contextlib.contextmanager
    def start() -> Iterator[Executor]:
        executor = client.get_executor(pure=False, retries=3)
        try:
            yield executor
        finally:
            executor.shutdown(wait=False)

    with client:
        yield Workers(start, None, (KilledWorker,), address)


def outcomes(
    work: Callable[[Sequence[Task]], Result], tasks: Sequence[Task], workers: Workers, *, batch: int = BATCH
) -> Iterator[tuple[Sequence[Task], Result | Lost]]:
    """Yield batches of tasks with their results, as they are finished.

    If a worker dies, the batches that were handed out are lost. Their tasks are repeated, each as a separate batch. If
    a worker dies again during such a task, its result is :data:`LOST`.

    Parameters
    ----------
    work : callable
        Picklable function that takes a batch and returns its result.
    tasks : sequence
    workers : Workers
    batch : int
        Maximum number of tasks per batch. If the number of workers is known, each gets at least four batches, so that
        none waits long for the last worker. Only :data:`AHEAD` batches per worker are then handed out at a time;
        otherwise all batches are handed out immediately.

    Raises
    ------
    ProgramError
        With exit code 1 if the workers of a cluster disappear or cannot do this work.
    """
    size = batch if workers.count is None else max(1, min(batch, len(tasks) // (4 * workers.count)))
    waiting: deque[Sequence[Task]] = deque(tasks[at : at + size] for at in range(0, len(tasks), size))
    while waiting:
        interrupted: list[Task] = []
        ahead = len(waiting) if workers.count is None else AHEAD * workers.count
        for done, result in _until_one_dies(work, waiting, workers, ahead):
            if isinstance(result, Lost):
                interrupted += done
            else:
                yield done, result
        alone: deque[Sequence[Task]] = deque([task] for task in interrupted)
        while alone:
            yield from _until_one_dies(work, alone, workers, 1)


def _until_one_dies(
    work: Callable[[Sequence[Task]], Result], waiting: deque[Sequence[Task]], workers: Workers, ahead: int
) -> Iterator[tuple[Sequence[Task], Result | Lost]]:
    """Yield batches and results of one executor until a worker dies.

    Batches lost with the worker are yielded last, with :data:`LOST`; batches not yet handed out stay in ``waiting``.
    """
    running: dict[Future[Result], Sequence[Task]] = {}
    lost: list[Sequence[Task]] = []
    with workers.start() as executor:
        try:
            while running or (waiting and not lost):
                while waiting and not lost and len(running) < ahead:
                    batch = waiting.popleft()
                    try:
                        running[executor.submit(work, batch)] = batch
                    except workers.died:
                        lost.append(batch)
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    batch = running.pop(future)
                    try:
                        result = future.result()
                    except workers.died:
                        lost.append(batch)
                    except (CancelledError, Exception) as error:
                        if not workers.address:
                            raise
                        reason = f"{type(error).__name__}: {' '.join(str(error).split())}"
                        message = f"{workers.address}: a batch of runs failed ({reason}); run springmass batch again"
                        raise ProgramError(message, SOME_FAILED) from error
                    else:
                        yield batch, result
        finally:
            for future in running:
                future.cancel()
    yield from ((batch, LOST) for batch in lost)
