"""The command line called in this process, and recordings to call it on."""

import json
import logging
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import springmass
from springmass.charts import draw
from springmass.cli import main
from springmass.errors import LOG

TITLE = b"Motion Sensor Data File Mar 12, 2024 2:05 PM"
COLUMNS = b"Time (s)\tDistance (cm)\tDist Error (cm)"


@dataclass(frozen=True, slots=True)
class Done:
    """What a command did: its exit code, and what it wrote on stdout and stderr."""

    code: int
    out: str
    err: str

    @property
    def results(self) -> list[Any]:
        """Stdout, every line of it read as JSON."""
        return [json.loads(line) for line in self.out.splitlines()]

    @property
    def complaint(self) -> str:
        """The single line on stderr."""
        (line,) = self.err.splitlines()
        return line


BENCH = """
[bob]
mass_kg = 0.2
[spring]
constant_n_per_m = 20.0
[start]
displacement_m = 0.05
"""
MIXED = f"{BENCH}[damping]\ngamma_per_s = 0.0073\nbeta_per_m_s = 0.235\n"
VIEWED_S = 60.0
"""The longest time until a page shows its motion."""
Cli = Callable[..., Any]
"""What calls a command line, and returns a `Done`."""


class Viewer(logging.Handler):
    """Looks at a page once its address is printed, and ends the program as Ctrl-C does."""

    def __init__(self) -> None:
        super().__init__()
        self.seen: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Begin to look where a message has the address."""
        if (line := record.getMessage()).startswith("page: http"):
            threading.Thread(target=self._look, args=(line.removeprefix("page: "),)).start()

    def _look(self, address: str) -> None:
        from tests.pages.bench import Client  # it imports playwright, which few of these tests need

        try:
            with Client(address).socket() as messages:
                until = time.monotonic() + VIEWED_S
                while time.monotonic() < until:
                    message = messages.recv(timeout=VIEWED_S)
                    if isinstance(message, str) and '"estimates"' in message:
                        self.seen.append(message)
                        break
        finally:
            os.kill(os.getpid(), signal.SIGINT)


@pytest.fixture
def viewer() -> Iterator[Viewer]:
    """Return what has looked at the pages of a test, each of which ends once it was seen."""
    seeing = Viewer()
    LOG.addHandler(seeing)
    yield seeing
    LOG.removeHandler(seeing)


@pytest.fixture
def cli(capsys: pytest.CaptureFixture[str]) -> Callable[..., Done]:
    """Return a function that runs a command line here."""

    def run(*arguments: str | Path) -> Done:
        capsys.readouterr()
        code = main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return Done(code, captured.out, captured.err)

    return run


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no picture be drawn, which takes most of the time; whether there is one is seen from its name."""
    monkeypatch.setattr(draw, "render", lambda _, kinds: dict.fromkeys(kinds, b"<svg/>"))


@pytest.fixture(scope="session")
def data() -> Path:
    """Return the folder of the bundled recordings."""
    return springmass.sample_data()


@pytest.fixture(scope="session")
def rows(data: Path) -> list[bytes]:
    """Return the rows of the undamped position recording, 10 s at 100 Hz."""
    return (data / "undamped_simulated_position.txt").read_bytes().split(b"\r\n")[2:]


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """Return a function that writes a MotionSensor.vi position file of these rows."""

    def file(rows: list[bytes], name: str = "run.txt", *, end: bytes = b"") -> Path:
        path = tmp_path / name
        path.write_bytes(b"\r\n".join([TITLE, COLUMNS, *rows]) + end)
        return path

    return file


@pytest.fixture
def recording(write: Callable[..., Path], rows: list[bytes]) -> Path:
    """Return a sound recording in a new folder."""
    return write(rows)
