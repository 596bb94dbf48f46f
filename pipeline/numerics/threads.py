"""Threads: linear algebra runs on one thread during an analysis, and afterwards on as many as before.

The matrices of an analysis have few columns, so a second thread gains nothing. Where other programs keep the cores
busy, each of hundreds of decompositions waits for the second thread: 5 to 11 s instead of 0.15 s on one thread.
"""

from __future__ import annotations

import functools
import threading
from contextlib import ContextDecorator
from typing import Any


class _OneThread(ContextDecorator):
    """Restrict numpy's and scipy's linear algebra to one thread, in a ``with`` block or as a decorator.

    The number of threads applies to the whole process. Where analyses run concurrently, the first to begin sets it and
    the last to end restores it.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._inside = 0
        self._before: Any = None

    def __enter__(self) -> None:
        with self._lock:
            if self._inside == 0:
                self._before = _libraries().limit(limits=1, user_api="blas")
                _let_go()
            self._inside += 1

    def __exit__(self, *exc: object) -> None:
        with self._lock:
            self._inside -= 1
            if self._inside == 0:
                self._before.restore_original_limits()
                _let_go()


one_thread = _OneThread()


@functools.cache
def _libraries() -> Any:
    """Return the loaded linear algebra libraries; the search takes a millisecond, so it is done once."""
    # scipy brings its own library, which the search would miss if it were loaded later.
    import scipy.linalg  # noqa: F401
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def _let_go() -> None:
    """Let any thread set the limit, which threadpoolctl otherwise reserves for the first one until its block ends."""
    with _libraries().limit():
        pass
