"""The command line called in this process, and recordings to call it on."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import springmass
from springmass.cli import main

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
Cli = Callable[..., Any]
"""What calls a command line, and returns a `Done`."""


@pytest.fixture
def cli(capsys: pytest.CaptureFixture[str]) -> Callable[..., Done]:
    """Return a function that runs a command line here."""

    def run(*arguments: str | Path) -> Done:
        capsys.readouterr()
        code = main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return Done(code, captured.out, captured.err)

    return run


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
