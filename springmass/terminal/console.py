"""Write messages and progress rewritten in place to stderr, from a separate thread.

A write to stderr may block or fail: a pipe is full, its reader has gone, a terminal hangs or was closed, a disk is
full. Other threads therefore put their lines into a queue and continue, and only this thread waits for a reader. Failed
writes are counted, and the end waits at most a second for the thread.
"""

import os
import sys
import threading
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, TextIO

from acquisition.errors import visible
from springmass.session.failures import Worker

if TYPE_CHECKING:
    from rich.live import Live


class Console:
    """Writes to stderr without blocking its callers; close it at the end.

    ``failed`` gets, on any thread, the exception of a write, or a TimeoutError if a write does not end.
    """

    def __init__(self, failed: Callable[[BaseException], None]) -> None:
        self._stream = _duplicate(sys.stderr)
        self._live: Live | None = None
        self._lines: Sequence[str] = ()
        self._drawing = False  # whether the queue contains a step that draws the latest lines
        self._worker = Worker("console", failed)

    def line(self, text: str) -> None:
        """Write text as one line, with line breaks joined and control characters made visible."""
        line = visible(" ".join(text.splitlines()))
        self._worker.put(lambda: self._write(line))

    def draw(self, lines: Sequence[str]) -> None:
        """Draw lines on the terminal over the earlier ones; a slow terminal gets only the latest lines."""
        self._lines = [visible(line) for line in lines]
        if not self._drawing:
            self._drawing = True
            self._worker.put(self._draw)

    def settle(self) -> None:
        """Leave the drawn lines in place, and restore the cursor."""
        self._worker.put(self._settle)

    def wait(self, seconds: float) -> None:
        """Wait until all lines are written; report a failure if this takes longer than the given time."""
        written = threading.Event()
        self._worker.put(written.set)
        if not written.wait(seconds):
            self._worker.failed(TimeoutError("nobody reads stderr"))

    def close(self) -> None:
        """Wait until all lines are written, at most a second; lines not written by then are lost."""
        self.settle()
        if self._stream is not None and self._stream is not sys.stderr:
            self._worker.put(self._stream.close)
        self._worker.close("nobody reads stderr")

    def _write(self, line: str) -> None:
        if self._stream is None:
            raise OSError("stderr is closed")
        if self._live is not None:
            self._live.console.print(line, markup=False, highlight=False, soft_wrap=True)
            return
        self._stream.write(line + "\n")
        self._stream.flush()

    def _draw(self) -> None:
        from rich.console import Console as RichConsole
        from rich.live import Live
        from rich.text import Text

        self._drawing = False
        if self._live is None:
            rich = RichConsole(file=self._stream, force_terminal=True)
            # The other streams are not redirected, so that nothing else has to wait for this terminal.
            self._live = Live(console=rich, auto_refresh=False, redirect_stdout=False, redirect_stderr=False)
            self._live.start()
        self._live.update(Text("\n".join(self._lines), no_wrap=True, overflow="crop"), refresh=True)

    def _settle(self) -> None:
        live, self._live = self._live, None
        if live is not None:
            live.stop()


def _duplicate(stream: TextIO | None) -> TextIO | None:
    """Return a duplicate of a stream, because Python would wait at exit for a thread that writes to stderr itself."""
    if stream is None:
        return None
    try:
        return open(os.dup(stream.fileno()), "w", encoding=stream.encoding, errors="backslashreplace", buffering=1)
    except (OSError, ValueError, AttributeError):  # a stream without a descriptor, as in a test or a notebook
        return stream
