"""``springmass record`` of boards and adapters as benches have them, on a pseudo-terminal."""

import contextlib
import math
import os
import pty
import select
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from springmass import load
from tests.cli.conftest import Cli

T_S = 0.790066


def distance_cm(t: float) -> float:
    """Return where the bob is."""
    return 26.9 + 5.2 * math.cos(2 * math.pi * t / T_S)


@contextmanager
def board(act: Callable[[int, threading.Event], None]) -> Iterator[str]:
    """Yield the name of a port; ``act`` writes to its other end until the test ends."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    stop = threading.Event()
    thread = threading.Thread(target=act, args=(master, stop))
    thread.start()
    try:
        yield os.ttyname(slave)
    finally:
        stop.set()
        thread.join()
        os.close(slave)
        os.close(master)


def send_lines(
    master: int, stop: threading.Event, rate_hz: float = 50.0, together: int = 1, form: bytes = b"%.2f cm\r\n"
) -> None:
    """Send lines at an even rate, some of them together."""
    start, held, count = time.monotonic(), b"", 0
    while not stop.wait(max(0.0, start + count / rate_hz - time.monotonic())):
        held += form % distance_cm(count / rate_hz)
        count += 1
        if count % together == 0:
            with contextlib.suppress(BlockingIOError):
                os.write(master, held)
            held = b""


def test_lines_that_come_together_are_all_used(cli: Cli, tmp_path: Path) -> None:
    """Twelve lines every quarter of a second have their own times, a report says so, and T is right."""
    with board(lambda master, stop: send_lines(master, stop, 50.0, 12)) as port:
        named = ("--port", port, "--sensor", "text-lines", "--seconds", "8")
        done = cli("record", *named, "-o", tmp_path / "run.h5")
    assert done.code == 0, done.err
    assert "lines per second without a time" in done.err
    samples = load(tmp_path / "run.h5").loaded.samples
    assert np.all(np.diff(samples.t) > 0.0)
    assert np.ptp(np.diff(samples.t)) < 1e-6


def test_a_board_may_need_a_while_or_a_character(cli: Cli, tmp_path: Path) -> None:
    """One that begins after five seconds of nothing is waited for, and one that waits for a character gets it."""

    def slow(master: int, stop: threading.Event) -> None:
        if not stop.wait(5.0):
            send_lines(master, stop)

    def asking(master: int, stop: threading.Event) -> None:
        os.write(master, b"Send any character to begin\r\n")
        while not stop.is_set() and not select.select([master], [], [], 0.1)[0]:
            pass
        send_lines(master, stop)

    for act, options in ((slow, ()), (asking, ("--send", "x"))):
        with board(act) as port:
            named = ("--port", port, "--sensor", "text-lines", "--seconds", "1", *options)
            done = cli("record", *named, "-o", tmp_path / f"{act.__name__}.h5")
        assert done.code == 0, done.err


def test_another_reader_of_the_port_is_reported(cli: Cli, tmp_path: Path) -> None:
    """The bytes that come are kept, the port stays open, and the run says that another program read it."""
    stopped = threading.Event()

    def other(port: str) -> None:
        descriptor = os.open(port, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
        while not stopped.is_set():
            if select.select([descriptor], [], [], 0.1)[0]:
                with contextlib.suppress(OSError):
                    os.read(descriptor, 64)
        os.close(descriptor)

    with board(send_lines) as port:
        reader = threading.Thread(target=other, args=(port,))
        reader.start()
        done = cli("record", "--port", port, "--sensor", "text-lines", "--seconds", "5", "-o", tmp_path / "run.h5")
        stopped.set()
        reader.join()
    assert "another program" in done.err.lower()
    assert "disconnected" not in done.err


def test_seven_data_bits_are_named_and_read(cli: Cli, tmp_path: Path) -> None:
    """Text with a parity bit is no noise: the message names the option that reads it."""

    def parity(master: int, stop: threading.Event) -> None:
        start, count = time.monotonic(), 0
        while not stop.wait(max(0.0, start + count / 50.0 - time.monotonic())):
            line = b"%.2f cm\r\n" % distance_cm(count / 50.0)
            with contextlib.suppress(BlockingIOError):
                os.write(master, bytes(byte | 0x80 if byte.bit_count() % 2 else byte for byte in line))
            count += 1

    with board(parity) as port:
        named = ("--port", port, "--sensor", "text-lines", "--seconds", "1", "-o", tmp_path / "run.h5")
        done = cli("record", *named)
        assert (done.code, "--framing 7E1" in done.err) == (4, True)
        assert cli("record", *named, "--framing", "7E1").code == 0
    assert len(load(tmp_path / "run.h5").loaded.samples) > 10


def test_recover_reads_kept_bytes_with_other_options(cli: Cli, tmp_path: Path) -> None:
    """A log that was recorded with a wrong unit is read anew with the right one."""
    with board(lambda master, stop: send_lines(master, stop, form=b"%.2f\r\n")) as port:
        named = ("--port", port, "--sensor", "text-lines", "--option", "unit=mm", "--seconds", "1")
        assert cli("record", *named, "-o", tmp_path / "run.h5").code == 0
    (tmp_path / "kept").mkdir()
    assert cli("convert", tmp_path / "run.h5", tmp_path / "kept").code == 0
    (log,) = (tmp_path / "kept").glob("*.wire")
    assert cli("recover", log, "--option", "unit=cm", "-o", tmp_path / "again.h5").code == 0
    first, again = (load(tmp_path / name).loaded.samples.distance for name in ("run.h5", "again.h5"))
    np.testing.assert_allclose(again, 10.0 * first)
