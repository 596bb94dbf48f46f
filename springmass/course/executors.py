"""Run tasks in this process, in processes of this machine, or on a dask cluster, with one loop for all of them."""

import contextlib
import logging
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from contextlib import AbstractContextManager
from dataclasses import dataclass
from multiprocessing import active_children, get_context, parent_process
from typing import Any, TypeVar

from springmass.errors import LOG, SOME_FAILED, ProgramError, at_level, print_messages

Item = TypeVar("Item")
Result = TypeVar("Result")
AHEAD = 2  # tasks handed out per worker, so that no worker waits for its next one
TASKS_AHEAD = 500  # tasks handed out if the number of workers is not known
FEW_TASKS = 3  # up to this many tasks, starting a second process takes longer than it saves


@dataclass(frozen=True, slots=True)
class Workers:
    """Who does the tasks: ``start`` makes an executor, again after a worker has died, and it is given ``ahead`` tasks.

    ``died`` is what a future raises if its worker died. The address of a scheduler is empty on this machine.
    """

    start: Callable[[], AbstractContextManager[Executor]]
    ahead: int
    died: type[BaseException] = BrokenExecutor
    address: str = ""


class _ThisProcess(Executor):
    """Executor that does each task as soon as it is submitted."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        with at_level(logging.WARNING):  # as in the processes of a pool
            future.set_result(fn(*args, **kwargs))
        return future


@contextlib.contextmanager
def workers(tasks: int, processes: int | None = None, dask: str | None = None) -> Iterator[Workers]:
    """Yield those of a dask cluster, or processes of this machine, by default one per core."""
    number = min(processes or cores(), tasks)
    LOG.debug(f"processes: {number}" if dask is None else f"workers of {dask}")
    if dask is not None:
        with _dask(dask) as cluster:
            yield cluster
    elif number <= 1 or tasks <= FEW_TASKS:
        yield Workers(_ThisProcess, 1)
    else:
        yield Workers(lambda: pool(number), AHEAD * number)


@contextlib.contextmanager
def _dask(address: str) -> Iterator[Workers]:
    """Yield the workers of a cluster, which must find the inputs at the same paths as this process."""
    try:
        from distributed import Client, KilledWorker
    except ImportError as error:
        raise ProgramError("--dask needs dask.distributed", "pip install 'springmass[dask]'") from error
    connect: Any = Client
    try:
        client = connect(address, set_as_default=False, timeout=20)
    except (OSError, ValueError, TimeoutError) as error:
        reason = " ".join(str(error).split())
        raise ProgramError(f"{address}: no dask scheduler answers ({reason})", "start dask scheduler") from error

    @contextlib.contextmanager
    def start() -> Iterator[Executor]:
        executor = client.get_executor(pure=False, retries=3)
        try:
            yield executor
        finally:
            executor.shutdown(wait=False)

    with client:
        yield Workers(start, TASKS_AHEAD, KilledWorker, address)


def outcomes(
    work: Callable[[Item], Result], tasks: Iterable[Item], by: Workers
) -> Iterator[list[tuple[Item, Result | None]]]:
    """Yield tasks with their results, those together that are finished at the same time; ``work`` is picklable.

    If a worker dies, the tasks that were handed out are repeated one by one. If a worker dies again during one of them,
    its result is None.
    """
    waiting = deque(tasks)
    while waiting:
        lost = yield from _until_one_dies(work, waiting, by, by.ahead)
        for task in lost:
            if (yield from _until_one_dies(work, deque([task]), by, 1)):
                yield [(task, None)]


def _until_one_dies(
    work: Callable[[Item], Result], waiting: deque[Item], by: Workers, ahead: int
) -> Generator[list[tuple[Item, Result | None]], None, list[Item]]:
    """Yield tasks and results of one executor until a worker dies; return the tasks that were lost with it."""
    running: dict[Future[Result], Item] = {}
    lost: list[Item] = []
    with by.start() as executor:
        try:
            while running or (waiting and not lost):
                while waiting and not lost and len(running) < ahead:
                    task = waiting.popleft()
                    try:
                        running[executor.submit(work, task)] = task
                    except by.died:
                        lost.append(task)
                done: list[tuple[Item, Result | None]] = []
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    task = running.pop(future)
                    try:
                        done.append((task, future.result()))
                    except by.died:
                        lost.append(task)
                    except (CancelledError, Exception) as error:
                        if not by.address:
                            raise
                        reason = f"{type(error).__name__}: {' '.join(str(error).split())}"
                        wrong, remedy = f"{by.address}: a run failed ({reason})", "run springmass batch again"
                        raise ProgramError(wrong, remedy, SOME_FAILED) from error
                yield done
        finally:
            for future in running:
                future.cancel()
    return lost


def cores() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextlib.contextmanager
def pool(processes: int) -> Iterator[ProcessPoolExecutor]:
    """Yield a pool of new processes that print only problems, leave Ctrl-C to this one and end with it.

    After an error or Ctrl-C they are terminated, because a task may take minutes.
    """
    others = set(active_children())
    # New processes are spawned, because a fork of a process with linear-algebra threads may hang.
    with ProcessPoolExecutor(processes, get_context("spawn"), _begin) as executor:
        try:
            yield executor
        except BaseException:
            for process in set(active_children()) - others:
                process.terminate()
            raise


def _begin() -> None:
    """Print only problems, because messages about a recording go into its row; leave Ctrl-C to the parent process.

    The process ends with its parent; it would otherwise wait forever if the parent is killed.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    print_messages(logging.WARNING)
    parent = parent_process()
    if parent is not None:

        def follow() -> None:
            parent.join()
            os._exit(1)

        threading.Thread(target=follow, daemon=True).start()
