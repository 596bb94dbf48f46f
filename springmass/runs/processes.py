"""Processes that share work on this machine: how many are allowed, and pools of them."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import active_children, get_context, parent_process

from springmass.errors import adopt, manner


def cores() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextlib.contextmanager
def pool(processes: int) -> Iterator[ProcessPoolExecutor]:
    """Yield a pool of new processes that share this one's output settings, leave Ctrl-C to it and end with it.

    After an error or Ctrl-C they are terminated, because a task may take minutes.
    """
    others = set(active_children())
    # New processes are spawned, because a fork of a process with linear-algebra threads may hang.
    with ProcessPoolExecutor(processes, get_context("spawn"), _begin, manner()) as executor:
        try:
            yield executor
        except BaseException:
            for process in set(active_children()) - others:
                process.terminate()
            raise


def _begin(quiet: bool, verbose: bool) -> None:
    """Leave Ctrl-C to the parent process, and end with it.

    A pool's process would otherwise wait forever if its parent is killed.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    adopt(quiet, verbose)
    parent = parent_process()
    if parent is not None:

        def follow() -> None:
            parent.join()
            os._exit(1)

        threading.Thread(target=follow, daemon=True).start()
