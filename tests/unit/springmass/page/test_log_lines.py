"""Lines of the page's log: one a minute for each kind and client, never a traceback."""

from __future__ import annotations

import logging

import pytest

from springmass.page.web.log_lines import MOST_LINES, PERIOD_S, LogLines


class Log:
    """A logger whose lines are kept, and a clock that is set by hand."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.lines: list[str] = []
        self._handler = LogLines(self.lines.append, lambda: self.now_s)

    def warn(self, message: str, *values: object, client: str = "", error: Exception | None = None) -> None:
        """Log a warning."""
        exc_info = None if error is None else (type(error), error, error.__traceback__)
        record = logging.LogRecord("page", logging.WARNING, __file__, 1, message, values, exc_info)
        record.client = client
        self._handler.handle(record)


@pytest.fixture
def log() -> Log:
    """Return a log."""
    return Log()


def test_a_kind_of_a_client_is_one_line_a_minute(log: Log) -> None:
    """Another client, another message or another error is another line; the next minute says how many were left out."""
    for number in range(100):
        log.warn("message %d", number, client="10.0.0.1")
    log.warn("message %d", 7, client="10.0.0.2")
    log.warn("another")
    log.warn("another", error=ValueError("x"))
    assert len(log.lines) == 4
    log.now_s = PERIOD_S
    log.warn("message %d", 100, client="10.0.0.1")
    assert len(log.lines) == 5
    assert "99" in "".join(log.lines)


def test_many_clients_are_few_lines(log: Log) -> None:
    """However many kinds and clients there are, the lines of a minute are bounded."""
    for number in range(1000):
        log.warn("closed", client=f"10.0.{number // 250}.{number % 250}")
    assert len(log.lines) == MOST_LINES


def test_an_error_is_one_short_line(log: Log) -> None:
    """An exception's type, text and place stand on the line of its message, whatever their length."""
    try:
        raise KeyError("a\nb" * 1000)
    except KeyError as error:
        log.warn("broke\n", error=error)
    (line,) = log.lines
    assert "KeyError at test_log_lines.py:" in line
    assert "\n" not in line
    assert len(line) <= 300
