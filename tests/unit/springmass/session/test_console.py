"""Lines on stderr wait for nobody."""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Iterator
from typing import TextIO

import pytest

from acquisition.clock import SystemClock
from springmass.session import console as consoles
from springmass.session.console import Console


@pytest.fixture
def pipe() -> Iterator[tuple[int, TextIO]]:
    """Return a pipe: the end that is read, and the other as a text stream."""
    read, write = os.pipe()
    stream = open(write, "w", encoding="ascii")  # noqa: SIM115
    yield read, stream
    stream.close()
    os.close(read)


def test_a_line_is_one_line_with_what_the_code_lacks_escaped(pipe: tuple[int, TextIO]) -> None:
    """Line ends within become blanks, letters that the stream cannot hold stand escaped."""
    read, stream = pipe
    failed: list[BaseException] = []
    Console(SystemClock(), failed.append, stream).line("a\nb µ")
    assert os.read(read, 100) == b"a b \\xb5\n"
    assert failed == []


def test_nobody_who_reads_is_waited_for_once(pipe: tuple[int, TextIO], monkeypatch: pytest.MonkeyPatch) -> None:
    """A full pipe costs the patience for all lines together; each line left out is a failure."""
    monkeypatch.setattr(consoles, "PATIENCE_S", 0.2)
    _, stream = pipe
    os.set_blocking(stream.fileno(), False)
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(stream.fileno(), b"x" * 4096)
    os.set_blocking(stream.fileno(), True)
    clock, failed = SystemClock(), []
    console = Console(clock, failed.append, stream)
    start_ns = clock.now_ns()
    for _ in range(100):
        console.line("nobody hears this")
    assert clock.now_ns() - start_ns < 5e9  # a hundred times the patience would be 20 s
    assert [type(error) for error in failed] == [TimeoutError] * 100


def test_a_stream_that_is_closed_or_absent_is_a_failure_and_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is raised, and it is no terminal."""
    monkeypatch.setattr("sys.stderr", None)
    closed = io.StringIO()
    closed.close()
    for stream in (None, closed):
        failed: list[BaseException] = []
        console = Console(SystemClock(), failed.append, stream)
        console.line("nobody hears this")
        assert not console.terminal
        assert len(failed) == 1
