"""Processes that share work on this machine: how many are allowed, and pools of them."""

from __future__ import annotations

import os
import signal
import threading
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context, parent_process

from springmass.errors import adopt, manner


def cores() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def pool(processes: int) -> ProcessPoolExecutor:
    """Return a pool of new processes that share this one's output settings, leave Ctrl-C to it and end with it."""
    # New processes are spawned, because a fork of a process with linear-algebra threads may hang.
    return ProcessPoolExecutor(processes, get_context("spawn"), _begin, manner())


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
