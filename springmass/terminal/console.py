"""Lines for people on stderr, and progress rewritten in place, written by a separate thread.

A write to stderr may block or fail: a pipe is full, its reader has gone, a terminal hangs or was closed, a disk is
full. So other threads put their lines into a queue and go on, and only this thread waits for a reader. Failed writes
are counted, and the end waits at most a second for the thread.
"""

from __future__ import annotations

import os
import queue
import sys
import threading
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Self, TextIO

from acquisition.errors import visible

if TYPE_CHECKING:
    from rich.live import Live

__all__ = ["Console"]

PATIENCE_S = 1.0
"""So long the end waits for a reader of what is not written yet."""


class Console:
    """Writes to stderr without making anybody wait; used in a ``with``.

    Parameters
    ----------
    failed : callable
        Takes what a write raised, or a TimeoutError where one does not end. Any thread may call it.
    stream : text stream, optional
        Left out, ``sys.stderr``.
    """

    def __init__(self, failed: Callable[[BaseException], None], stream: TextIO | None = None) -> None:
        self._failed = failed
        self._given = sys.stderr if stream is None else stream
        self._stream = _duplicate(self._given)
        self._live: Live | None = None
        self._lines: Sequence[str] = ()
        self._drawing = False  # whether a step that draws the latest lines is in the queue
        self._steps: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="springmass-console", daemon=True)
        try:
            self._thread.start()
        except RuntimeError as error:  # no memory for a thread
            failed(error)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def terminal(self) -> bool:
        """Whether it is a terminal."""
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
        """Write a line, also if a file's name breaks over several; control characters in it become visible."""
        line = visible(" ".join(text.splitlines()))
        self._steps.put(lambda: self._write(line))

    def draw(self, lines: Sequence[str]) -> None:
        """Draw lines on the terminal over those drawn before; where it is slow, only the latest."""
        self._lines = [visible(line) for line in lines]
        if not self._drawing:
            self._drawing = True
            self._steps.put(self._draw)

    def settle(self) -> None:
        """Leave the lines that were drawn where they are, and give the cursor back."""
        self._steps.put(self._settle)

    def wait(self, seconds: float) -> None:
        """Return when all is written; after the time given it is a failure that it is not."""
        written = threading.Event()
        self._steps.put(written.set)
        if not written.wait(seconds):
            self._failed(TimeoutError("nobody reads stderr"))

    def close(self) -> None:
        """Return when all is written, or after a second; what is not written by then is left out."""
        if self._thread.ident is None:
            return
        self._steps.put(self._settle)
        self._steps.put(None)
        self._thread.join(PATIENCE_S)
        if self._thread.is_alive():
            self._failed(TimeoutError("nobody reads stderr"))

    def _run(self) -> None:
        while (step := self._steps.get()) is not None:
            self._attempt(step)
        if self._stream is not None and self._stream is not self._given:
            self._attempt(self._stream.close)

    def _attempt(self, step: Callable[[], None]) -> None:
        try:
            step()
        except BaseException as error:  # whatever it is, it is no reason to say nothing more
            self._failed(error)

    def _write(self, line: str) -> None:
        if self._stream is None:
            raise OSError("stderr is closed")
        if self._live is not None:
            self._live.console.print(line, markup=False, highlight=False, soft_wrap=True)
            return
        self._stream.write(line + "\n")
        self._stream.flush()

    def _draw(self) -> None:
        from rich.text import Text

        self._drawing = False
        if self._live is None:
            self._live = self._begin()
        self._live.update(Text("\n".join(self._lines), no_wrap=True, overflow="crop"), refresh=True)

    def _begin(self) -> Live:
        from rich import console
        from rich.live import Live

        rich = console.Console(file=self._stream, force_terminal=True)
        # The other streams are not redirected: nothing else may come to wait for this terminal.
        live = Live(console=rich, auto_refresh=False, redirect_stdout=False, redirect_stderr=False)
        live.start()
        return live

    def _settle(self) -> None:
        live, self._live = self._live, None
        if live is not None:
            live.stop()


def _duplicate(stream: TextIO | None) -> TextIO | None:
    """Return a stream of one's own to the same place: Python waits at its end for a thread that writes to stderr."""
    if stream is None:
        return None
    try:
        return open(os.dup(stream.fileno()), "w", encoding=stream.encoding, errors="backslashreplace", buffering=1)
    except (OSError, ValueError, AttributeError):  # of a test or a notebook, which has no descriptor
        return stream
