"""``springmass record`` of boards and adapters as benches have them, on a pseudo-terminal."""

import contextlib
import math
import os
import select
import threading
from pathlib import Path

import numpy as np
import pytest

from springmass import load
from tests.cli.conftest import Cli
from tests.faults.conftest import on_a_terminal


def line(number: int, form: bytes = b"%.2f cm\r\n") -> bytes:
    """Return what a board prints of a swing of 0.79 s as its reading of a number, at 100 Hz."""
    return form % (26.9 + 5.2 * math.cos(math.tau * number / 79.0))


def test_lines_that_come_together_are_all_used(cli: Cli, tmp_path: Path) -> None:
    """Twelve lines every eighth of a second have their own times, and a report says so."""

    def together(number: int) -> bytes:
        return b"".join(map(line, range(number - 11, number + 1))) if number % 12 == 11 else b""

    with on_a_terminal(together) as port:
        named = ("--port", port, "--sensor", "text-lines", "--seconds", "8")
        done = cli("record", *named, "-o", tmp_path / "run.h5")
    assert done.code == 0, done.err
    assert "lines per second without a time" in done.err
    samples = load(tmp_path / "run.h5").loaded.samples
    assert np.all(np.diff(samples.t) > 0.0)
    assert np.ptp(np.diff(samples.t)) < 1e-6


@pytest.mark.parametrize(("silent", "options"), [(500, {}), (0, {"waits": True})], ids=["a while", "a character"])
def test_a_board_may_need_a_while_or_a_character(
    cli: Cli, tmp_path: Path, silent: int, options: dict[str, bool]
) -> None:
    """One that begins after five seconds of nothing is waited for, and one that waits for a character gets it."""
    with on_a_terminal(lambda number: line(number) if number >= silent else b"", **options) as port:
        named = ("--port", port, "--sensor", "text-lines", "--seconds", "1", *(("--send", "x") if options else ()))
        done = cli("record", *named, "-o", tmp_path / "run.h5")
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

    with on_a_terminal(line) as port:
        reader = threading.Thread(target=other, args=(port,))
        reader.start()
        done = cli("record", "--port", port, "--sensor", "text-lines", "--seconds", "5", "-o", tmp_path / "run.h5")
        stopped.set()
        reader.join()
    assert "another program" in done.err.lower()
    assert "disconnected" not in done.err


def test_seven_data_bits_are_named_and_read(cli: Cli, tmp_path: Path) -> None:
    """Text with a parity bit is no noise: the message names the option that reads it."""

    def parity(number: int) -> bytes:
        return bytes(byte | 0x80 if byte.bit_count() % 2 else byte for byte in line(number))

    with on_a_terminal(parity) as port:
        named = ("--port", port, "--sensor", "text-lines", "--seconds", "1", "-o", tmp_path / "run.h5")
        done = cli("record", *named)
        assert (done.code, "--framing 7E1" in done.err) == (4, True)
        assert cli("record", *named, "--framing", "7E1").code == 0
    assert len(load(tmp_path / "run.h5").loaded.samples) > 10


def test_recover_reads_kept_bytes_with_other_options(cli: Cli, tmp_path: Path) -> None:
    """A log that was recorded with a wrong unit is read anew with the right one."""
    with on_a_terminal(lambda number: line(number, b"%.2f\r\n")) as port:
        named = ("--port", port, "--sensor", "text-lines", "--option", "unit=mm", "--seconds", "1")
        assert cli("record", *named, "-o", tmp_path / "run.h5").code == 0
    (tmp_path / "kept").mkdir()
    assert cli("convert", tmp_path / "run.h5", tmp_path / "kept").code == 0
    (log,) = (tmp_path / "kept").glob("*.wire")
    assert cli("recover", log, "--option", "unit=cm", "-o", tmp_path / "again.h5").code == 0
    first, again = (load(tmp_path / name).loaded.samples.distance for name in ("run.h5", "again.h5"))
    np.testing.assert_allclose(again, 10.0 * first)
