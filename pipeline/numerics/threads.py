"""Threads: linear algebra inside an analysis runs on one thread, afterwards on as many as before.

The matrices of an analysis have few columns. A second thread gains nothing on them, and where other programs keep
the cores busy each of hundreds of decompositions waits for it: 5 to 11 s where one thread takes 0.15 s.
"""

from __future__ import annotations

import functools
import threading
from contextlib import ContextDecorator
from typing import Any

__all__ = ["one_thread"]


class _OneThread(ContextDecorator):
    """Holds numpy's and scipy's linear algebra to one thread, in a ``with`` block or as a decorator.

    Notes
    -----
    The number of threads is the process's. Where analyses run side by side the first to begin sets it and the last to
    end puts it back.
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
    """Return the loaded linear algebra libraries; looking for them takes a millisecond, so it is done once."""
    # scipy brings another library: loaded later, it would not be found.
    import scipy.linalg  # noqa: F401
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def _let_go() -> None:
    """Let any thread set the number: threadpoolctl allows it to the first that does, until its block ends."""
    with _libraries().limit():
        pass
