"""Lines for people on stderr, which never hold up whoever writes them.

Nobody may read it: a pipe that is full, a reader that has gone, a terminal that was closed, a disk without room. A line
then waits a moment for its turn, once; what cannot be written is counted as a failure of the display.
"""

from __future__ import annotations

import os
import select
import sys
import threading
from collections.abc import Callable
from typing import TextIO

from acquisition.clock import Clock
from acquisition.errors import visible

__all__ = ["Console"]

PATIENCE_S = 1.0
"""So long a line waits for a reader of stderr, in all."""
PIECE_BYTES = 512
"""A pipe that takes a byte takes as many whole (POSIX's least PIPE_BUF)."""


class Console:
    """Writes to stderr without waiting for whoever reads it.

    Parameters
    ----------
    clock : Clock
    failed : callable
        Takes what a write raised.
    stream : text stream, optional
        Left out, ``sys.stderr``.
    """

    def __init__(self, clock: Clock, failed: Callable[[BaseException], None], stream: TextIO | None = None) -> None:
        self._clock = clock
        self._failed = failed
        self._stream = sys.stderr if stream is None else stream
        self._patience_s = PATIENCE_S
        self._lock = threading.Lock()
        self._descriptor = _descriptor(self._stream)

    @property
    def terminal(self) -> bool:
        """Whether a line can be rewritten in place."""
        try:
            return self._stream is not None and self._stream.isatty()
        except (OSError, ValueError):
            return False

    @property
    def columns(self) -> int:
        """How wide the terminal is now."""
        try:
            return max(os.get_terminal_size(self._stream.fileno()).columns, 1) if self._stream is not None else 80
        except (OSError, ValueError, AttributeError):
            return 80

    def line(self, text: str) -> None:
        """Write a line, also where a file's name breaks over several, control characters in it made visible."""
        self.write(visible(" ".join(text.splitlines())) + "\n")

    def write(self, text: str, patience_s: float | None = None) -> None:
        """Write text as it is; within that time, left out within what is left of a second for all lines."""
        if not self._lock.acquire(timeout=PATIENCE_S):
            return  # the other thread's line is stuck, and has been counted or will be
        try:
            if self._descriptor is None:
                self._write_stream(text)
            else:
                encoding = self._stream.encoding or "utf-8"
                self._write_pieces(text.encode(encoding, "backslashreplace"), patience_s)
        except (OSError, ValueError) as error:
            self._failed(error)
        finally:
            self._lock.release()

    def _write_stream(self, text: str) -> None:
        if self._stream is None:
            raise OSError("stderr is closed")
        self._stream.write(text)
        self._stream.flush()

    def _write_pieces(self, data: bytes, patience_s: float | None) -> None:
        """Write past Python's own stream: one that hangs in a write would hang the program's end too."""
        assert self._descriptor is not None
        start_ns = self._clock.now_ns()
        limit_s = self._patience_s if patience_s is None else min(patience_s, self._patience_s)
        try:
            while data:
                left_s = limit_s - (self._clock.now_ns() - start_ns) * 1e-9
                if not _writable(self._descriptor, max(left_s, 0.0)):
                    raise TimeoutError("nobody reads stderr")
                data = data[os.write(self._descriptor, data[:PIECE_BYTES]) :]
        finally:
            if patience_s is None:
                self._patience_s = max(self._patience_s - (self._clock.now_ns() - start_ns) * 1e-9, 0.0)


def _descriptor(stream: TextIO | None) -> int | None:
    """Return the descriptor behind a stream; None where there is none, or one that cannot be waited on."""
    if stream is None or not hasattr(select, "poll"):
        return None
    try:
        return stream.fileno()
    except (OSError, ValueError, AttributeError):
        return None


def _writable(descriptor: int, wait_s: float) -> bool:
    poll = select.poll()
    poll.register(descriptor, select.POLLOUT)
    return bool(poll.poll(wait_s * 1e3))
