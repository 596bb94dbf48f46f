"""Run tasks in this process, in processes of this machine, or on a dask cluster, with one loop for all of them."""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import AbstractContextManager
from dataclasses import dataclass
from multiprocessing import active_children
from typing import Any, TypeVar

from springmass.errors import SOME_FAILED, USAGE, ProgramError
from springmass.runs.processes import cores, pool

Task = TypeVar("Task")
Result = TypeVar("Result")
BATCH = 25  # tasks per batch: what is lost if the program is killed, per process
AHEAD = 2  # batches handed out per worker, so that no worker waits for its next batch
FEW = 3  # up to this many tasks, starting a second process takes longer than it saves


@dataclass(frozen=True, slots=True)
class Workers:
    """Who does the tasks: ``start`` makes an executor, again after a worker has died.

    ``count`` tasks are done at the same time; None if workers come and go. ``died`` is what a future raises if its
    worker died. The address of a scheduler is empty if all work is done on this machine.
    """

    start: Callable[[], AbstractContextManager[Executor]]
    count: int | None
    died: type[BaseException] = BrokenExecutor
    address: str = ""


class _ThisProcess(Executor):
    """Executor that does each task as soon as it is submitted."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


@contextlib.contextmanager
def workers(tasks: int, processes: int | None = None, dask: str | None = None) -> Iterator[Workers]:
    """Yield those of a dask cluster, or processes of this machine, by default one per core."""
    number = min(processes or cores(), tasks)
    if dask is not None:
        with _dask(dask) as cluster:
            yield cluster
    elif number <= 1 or tasks <= FEW:
        yield Workers(_ThisProcess, 1)
    else:
        yield Workers(lambda: _pool(number), number)


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
def _dask(address: str) -> Iterator[Workers]:
    """Yield the workers of a cluster, which must find the inputs at the same paths as this process."""
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
        yield Workers(start, None, KilledWorker, address)


def outcomes(
    work: Callable[[Sequence[Task]], Result], tasks: Sequence[Task], by: Workers, size: int = BATCH
) -> Iterator[tuple[Sequence[Task], Result | None]]:
    """Yield batches of tasks with their results, as they are finished; ``work`` is picklable.

    If a worker dies, the tasks of the batches that were handed out are repeated one by one. If a worker dies again
    during such a task, its result is None. Each worker gets at least four batches, so that none waits long for the
    last one; :data:`AHEAD` batches per worker are handed out at a time, or all of them if workers come and go.
    """
    if by.count is not None:
        size = max(1, min(size, len(tasks) // (4 * by.count)))
    waiting = deque(tasks[at : at + size] for at in range(0, len(tasks), size))
    while waiting:
        lost = yield from _until_one_dies(work, waiting, by, AHEAD * by.count if by.count else len(waiting))
        alone: deque[Sequence[Task]] = deque([task] for batch in lost for task in batch)
        while alone:
            twice = yield from _until_one_dies(work, alone, by, 1)
            yield from ((batch, None) for batch in twice)


def _until_one_dies(
    work: Callable[[Sequence[Task]], Result], waiting: deque[Sequence[Task]], by: Workers, ahead: int
) -> Generator[tuple[Sequence[Task], Result], None, list[Sequence[Task]]]:
    """Yield batches and results of one executor until a worker dies; return the batches that were lost with it."""
    running: dict[Future[Result], Sequence[Task]] = {}
    lost: list[Sequence[Task]] = []
    with by.start() as executor:
        try:
            while running or (waiting and not lost):
                while waiting and not lost and len(running) < ahead:
                    batch = waiting.popleft()
                    try:
                        running[executor.submit(work, batch)] = batch
                    except by.died:
                        lost.append(batch)
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    batch = running.pop(future)
                    try:
                        result = future.result()
                    except by.died:
                        lost.append(batch)
                    except (CancelledError, Exception) as error:
                        if not by.address:
                            raise
                        reason = f"{type(error).__name__}: {' '.join(str(error).split())}"
                        message = f"{by.address}: a batch of runs failed ({reason}); run springmass batch again"
                        raise ProgramError(message, SOME_FAILED) from error
                    else:
                        yield batch, result
        finally:
            for future in running:
                future.cancel()
    return lost
