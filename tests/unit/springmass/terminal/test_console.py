"""Lines on stderr make nobody wait."""

from __future__ import annotations

import contextlib
import io
import os
import threading
from collections.abc import Iterator
from typing import TextIO

import pytest

from springmass.terminal import console as consoles
from springmass.terminal.console import Console


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wait longer at the end than the program does: a busy computer may still be importing."""
    monkeypatch.setattr(consoles, "PATIENCE_S", 60.0)


@pytest.fixture
def pipe() -> Iterator[tuple[int, TextIO]]:
    """Return a pipe: the end that is read, and the other as a text stream."""
    read, write = os.pipe()
    stream = open(write, "w", encoding="ascii")  # noqa: SIM115
    yield read, stream
    stream.close()
    os.close(read)


def fill(stream: TextIO) -> None:
    """Write to a pipe until it takes nothing more."""
    os.set_blocking(stream.fileno(), False)
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(stream.fileno(), b"x" * 4096)
    os.set_blocking(stream.fileno(), True)


def test_a_line_is_one_line_with_what_the_code_lacks_escaped(pipe: tuple[int, TextIO]) -> None:
    """Line ends within become blanks, letters that the stream cannot hold stand escaped."""
    read, stream = pipe
    failed: list[BaseException] = []
    with Console(failed.append, stream) as console:
        console.line("a\nb µ")
    assert os.read(read, 100) == b"a b \\xb5\n"
    assert failed == []


def test_lines_that_nobody_reads_make_nobody_wait(pipe: tuple[int, TextIO], monkeypatch: pytest.MonkeyPatch) -> None:
    """A full pipe holds up its own thread; the end waits for it once, and both are failures."""
    monkeypatch.setattr(consoles, "PATIENCE_S", 0.01)
    read, stream = pipe
    fill(stream)
    failed: list[BaseException] = []
    console = Console(failed.append, stream)
    for _ in range(100):
        console.line("nobody hears this")
        console.draw(["nor this"])
    assert failed == []
    console.wait(0.01)
    console.close()
    assert [type(error) for error in failed] == [TimeoutError] * 2
    os.set_blocking(read, False)
    while console._thread.is_alive():  # read the pipe empty, so that the thread ends
        with contextlib.suppress(BlockingIOError):
            os.read(read, 1 << 16)
        console._thread.join(0.01)


def test_of_what_is_drawn_while_a_line_hangs_the_latest_is_shown(pipe: tuple[int, TextIO]) -> None:
    """Lines drawn over one another do not queue up; lines above them all come."""
    read, stream = pipe
    failed: list[BaseException] = []
    console = Console(failed.append, stream)
    go_on = threading.Event()

    def hang() -> None:
        go_on.wait(60.0)

    console._steps.put(hang)
    for number in range(50):
        console.draw([f"frame {number}"])
    console.line("a line")
    go_on.set()
    console.close()
    shown = os.read(read, 1 << 16).decode()
    assert "frame 49" in shown
    assert "frame 48" not in shown
    assert "a line" in shown
    assert failed == []


def test_a_stream_that_is_closed_or_absent_is_a_failure_and_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is raised, and it is no terminal."""
    monkeypatch.setattr("sys.stderr", None)
    closed = io.StringIO()
    closed.close()
    for stream in (None, closed):
        failed: list[BaseException] = []
        with Console(failed.append, stream) as console:
            console.line("nobody hears this")
            assert not console.terminal
        assert len(failed) == 1
