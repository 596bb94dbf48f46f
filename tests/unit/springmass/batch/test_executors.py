"""Tasks are done by this process, by a pool or by dask; one that kills its worker costs its own result alone."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Sequence
from functools import partial
from multiprocessing import active_children

import pytest

from springmass.batch.executors import LOST, Lost, Workers, dask_workers, local_workers, outcomes
from springmass.errors import ProgramError

TASKS = list(range(40))
BUSY_S = 0.5  # before a worker dies; dask gives up a worker that dies while it starts


def squares(tasks: Sequence[int]) -> list[int]:
    """Return the squares of numbers."""
    return [task * task for task in tasks]


def squares_without(deadly: Sequence[int], tasks: Sequence[int]) -> list[int]:
    """Return the squares of numbers, in a process that dies of some."""
    if set(deadly) & set(tasks):
        until = time.process_time() + BUSY_S
        while time.process_time() < until:
            pass
        os.kill(os.getpid(), signal.SIGKILL)
    return squares(tasks)


def endless_but_first(tasks: Sequence[int]) -> list[int]:
    """Return the square of the first task; others take ten minutes."""
    until = time.process_time() + 600.0
    while 0 not in tasks and time.process_time() < until:
        pass
    return squares(tasks)


def refused(tasks: Sequence[int]) -> list[int]:
    """Stand for work that a worker cannot do."""
    raise ModuleNotFoundError("springmass")


def results(work, tasks: Sequence[int], workers: Workers, batch: int) -> dict[int, int | Lost]:
    """Return the result of each task; none may be given twice."""
    made: dict[int, int | Lost] = {}
    for done, result in outcomes(work, tasks, workers, batch=batch):
        assert not set(done) & made.keys()
        assert len(done) <= batch
        made.update(zip(done, [LOST] * len(done) if isinstance(result, Lost) else result, strict=True))
    return made


@pytest.mark.parametrize("processes", [1, 2])
@pytest.mark.parametrize("batch", [1, 7, 100])
def test_every_task_is_done_once(processes, batch):
    """Whatever the number of processes and the size of a batch."""
    workers = local_workers(len(TASKS), processes)
    assert workers.count == processes
    assert results(squares, TASKS, workers, batch) == {task: task * task for task in TASKS}
    assert results(squares, [], workers, batch) == {}


@pytest.mark.skipif(sys.platform == "win32", reason="kills a process by a signal")
def test_tasks_that_kill_a_process_are_isolated():
    """The pool is built again, and only those tasks have no result."""
    made = results(partial(squares_without, (7, 23)), TASKS, local_workers(len(TASKS), 2), 100)
    assert made == {task: LOST if task in (7, 23) else task * task for task in TASKS}


def test_processes_end_when_nobody_takes_their_results():
    """An error or Ctrl-C ends the processes at work, and does not wait for their batches."""
    others = set(active_children())
    began = time.monotonic()
    made = outcomes(endless_but_first, TASKS, local_workers(len(TASKS), 2), batch=1)
    assert next(made) == ([0], [0])
    assert set(active_children()) - others
    made.close()
    assert not set(active_children()) - others
    assert time.monotonic() - began < 300.0


@pytest.mark.trials
@pytest.mark.skipif(sys.platform == "win32", reason="kills a process by a signal")
def test_a_task_that_kills_a_worker_of_dask_is_isolated(monkeypatch, request):
    """The cluster starts its worker again, and only that task has no result."""
    monkeypatch.setenv("DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES", "0")  # instead of four deaths
    address, _ = request.getfixturevalue("cluster")
    with dask_workers(address) as workers:
        made = results(partial(squares_without, (7,)), TASKS, workers, 15)
    assert made == {task: LOST if task == 7 else task * task for task in TASKS}


def test_work_that_no_worker_of_dask_can_do_is_one_line(cluster):
    """An error of the workers names their scheduler."""
    with dask_workers(cluster[0]) as workers, pytest.raises(ProgramError, match=cluster[0]):
        results(refused, TASKS, workers, 100)
