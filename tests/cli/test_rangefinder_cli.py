"""A rangefinder of this project behind a port: what `record` and `springmass firmware` say of it and to it.

The board here is none of the decoder's: its lines are the page's, written out.
"""

import contextlib
import os
import pty
import threading
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from acquisition.live.firmware import FIRMWARE_VERSION, HEX
from tests.cli.conftest import Cli
from tests.encoders import sealed

PERIOD_S = 0.01


class Board:
    """Speaks as the firmware does, on a pseudo-terminal: silent until it is asked what it is, as after a reset.

    Every reading has the status ``letter``.
    """

    def __init__(self, version: str = FIRMWARE_VERSION, letter: str = "E") -> None:
        self.heard: list[str] = []
        self._version, self._letter = version, letter
        self._settings = {"R": "100", "G": "116,25000", "J": "0", "N": ""}
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.port = os.ttyname(self._slave)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def close(self) -> None:
        """Be switched off."""
        self._stop.set()
        self._thread.join()
        os.close(self._slave)
        os.close(self._master)

    def _run(self) -> None:
        received, number, began_s = b"", 0, 0.0
        while not self._stop.wait(PERIOD_S):
            with contextlib.suppress(BlockingIOError):
                received += os.read(self._master, 4096)
            while b"\n" in received:
                command, _, received = received.partition(b"\n")
                self.heard.append(command.decode("ascii"))
                self._obey(self.heard[-1])
            began_s = began_s or time.monotonic()
            while self.heard and number < (time.monotonic() - began_s) / PERIOD_S:
                echo = f"{2000 + number % 7:d}.25" if self._letter == "E" else ""
                self._send(sealed(f"R1,{number:010d},{number * 10_000:010d},{echo},,{self._letter}"))
                number += 1

    def _obey(self, command: str) -> None:
        if command == "R13":  # within the range that the command line allows, and refused by this one
            self._send(sealed("X1,command"))
            return
        if command != "?":
            self._settings[command[0]] = command[1:]
        rate, gate, spread, name = self._settings.values()
        self._send(sealed(f"I1,springmass-rangefinder,{self._version},{name},{rate},{gate},{spread},0"))

    def _send(self, data: bytes) -> None:
        with contextlib.suppress(BlockingIOError):  # nobody reads: lost, as on any line
            os.write(self._master, data)


@pytest.fixture
def board() -> Iterator[Callable[..., Board]]:
    """Return what makes boards; none outlives the test."""
    made: list[Board] = []

    def make(*arguments: str) -> Board:
        made.append(Board(*arguments))
        return made[-1]

    yield make
    for each in made:
        each.close()


def recorded(cli: Cli, port: str, out: Path, seconds: float) -> object:
    """Record what a board sends."""
    return cli("record", "--port", port, "--sensor", "line-protocol", "--seconds", str(seconds), "-o", out)


def test_record_asks_for_an_update_where_the_firmware_is_older(
    cli: Cli, board: Callable[..., Board], tmp_path: Path
) -> None:
    """And goes on with the one that is there."""
    here = board("1.4.2")
    done = recorded(cli, here.port, tmp_path / "run.h5", 0.5)
    assert "springmass-rangefinder 1.4.2" in done.err
    assert f"springmass firmware --port {here.port}" in done.err
    assert here.heard[0] == "?"
    assert (tmp_path / "run.h5").is_file()


@pytest.mark.parametrize(
    ("letter", "words"),
    [
        ("A", "does not answer its trigger"),
        pytest.param("S", "ECHO stays high", marks=pytest.mark.trials),
        pytest.param("N", "no target", marks=pytest.mark.trials),
    ],
)
def test_a_fault_that_the_sensor_knows_is_said_in_its_words(
    cli: Cli, board: Callable[..., Board], tmp_path: Path, letter: str, words: str
) -> None:
    """Once a second has passed without a distance; as none comes, the recording ends with 4."""
    done = recorded(cli, board(FIRMWARE_VERSION, letter).port, tmp_path / "run.h5", 2.5)
    assert words in done.err
    assert done.code == 4


def test_firmware_sets_a_board_and_shows_what_it_then_is(cli: Cli, board: Callable[..., Board]) -> None:
    """Each setting as the protocol's command; what the device does not take is said with exit code 4."""
    here = board()
    settings = ("--rate", "50", "--gate", "600,4000", "--spread", "1000", "--name", "bench-3")
    done = cli("firmware", "--port", here.port, *settings)
    assert done.code == 0, done.err
    assert all(words in done.out for words in (FIRMWARE_VERSION, "bench-3", "50 Hz", "600 to 4000 us"))
    assert [word for word in here.heard if word != "?"] == ["R50", "G600,4000", "J1000", "Nbench-3"]
    refused = cli("firmware", "--port", here.port, "--rate", "13")
    assert refused.code == 4
    assert "'R13'" in refused.complaint


def test_an_older_board_is_shown_how_to_flash(cli: Cli, board: Callable[..., Board]) -> None:
    """A line for avrdude at each speed of a bootloader, with the port; settings need a port."""
    port = board("1.4.2").port
    words = [line for line in cli("firmware", "--port", port).out.splitlines() if "-b " in line]
    assert [line.split("-b ")[1].split()[0] for line in words] == ["115200", "57600"]
    assert all(f"-P {port}" in line and f"flash:w:{HEX}:i" in line for line in words)
    assert cli("firmware", "--rate", "50").code == 2
