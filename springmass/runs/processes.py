"""Processes of this machine that share work: how many there may be, and pools of them."""

from __future__ import annotations

import os
import signal
import threading
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context, parent_process

from springmass.errors import adopt, manner

__all__ = ["cores", "pool"]


def cores() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def pool(processes: int) -> ProcessPoolExecutor:
    """Return a pool of fresh processes that speak as this one does, leave Ctrl-C to it and end with it."""
    # Fresh processes: a fork of one that has threads of linear algebra may hang.
    return ProcessPoolExecutor(processes, get_context("spawn"), _begin, manner())


def _begin(quiet: bool, verbose: bool) -> None:
    """Leave Ctrl-C to the first process, and end with it: a pool's process would wait for ever for one killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    adopt(quiet, verbose)
    parent = parent_process()
    if parent is not None:

        def follow() -> None:
            parent.join()
            os._exit(1)

        threading.Thread(target=follow, daemon=True).start()
