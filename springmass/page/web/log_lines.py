"""The log of the page's process on stderr: at most one line per minute for each kind of event and client."""

from __future__ import annotations

import contextlib
import logging
import time
from collections.abc import Callable, Iterator

from springmass.errors import complain
from springmass.session.failures import raised_at
from storage.errors import one_line

__all__ = ["LogLines", "log_to_stderr"]

PERIOD_S = 60.0
MOST_LINES = 20
"""Maximum number of lines per period over all kinds and clients: as many as a person can read in that time."""
LONGEST_LINE = 300


class LogLines(logging.Handler):
    """Writes each record as one line without a traceback, and omits kinds that it has already written in this minute.

    Records are of one kind if they have the same logger, message (before its arguments are inserted), type of exception
    and ``client`` (an attribute of the record). The next line that is written states how many records were omitted.

    Parameters
    ----------
    write : callable
        Receives a line.
    clock : callable
        Returns seconds.
    """

    def __init__(self, write: Callable[[str], None] = complain, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(logging.WARNING)
        self._write_line, self._clock = write, clock
        self._written: set[tuple[str, ...]] = set()
        self._began_s = clock()
        self._left_out = 0

    def emit(self, record: logging.LogRecord) -> None:
        """Write a record, or count it."""
        error = record.exc_info[1] if record.exc_info else None
        client = str(getattr(record, "client", ""))
        kind = (record.name, str(record.msg), type(error).__name__, client)
        if self._clock() - self._began_s >= PERIOD_S:
            self._began_s = self._clock()
            self._written.clear()
        if kind in self._written or len(self._written) >= MOST_LINES:
            self._left_out += 1
            return
        self._written.add(kind)
        line = one_line_of(record, client, error)
        if self._left_out:
            line += f" ({self._left_out} earlier messages were left out)"
            self._left_out = 0
        self._write_line(line)


def one_line_of(record: logging.LogRecord, client: str, error: BaseException | None) -> str:
    """Return a record as one line: client, message and, for an exception, its type, text and origin."""
    text = " ".join(record.getMessage().split())
    if error is not None:
        text = f"{text}: {type(error).__name__} at {raised_at(error)}: {one_line(error)}"
    return f"page: {f'{client}: ' if client else ''}{text}"[:LONGEST_LINE]


@contextlib.contextmanager
def log_to_stderr() -> Iterator[None]:
    """Write this process's log and Python's warnings with :class:`LogLines` until the ``with`` block ends."""
    handler, root = LogLines(), logging.getLogger()
    root.addHandler(handler)
    logging.captureWarnings(True)
    try:
        yield
    finally:
        logging.captureWarnings(False)
        root.removeHandler(handler)
