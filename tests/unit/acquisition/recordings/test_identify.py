"""The registry: formats by content, helpful refusals, and files that cannot be opened."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquisition.errors import UnknownFormat
from acquisition.recordings.identify import open_recording

ROWS = "".join(f"{i / 100:.3f}\t{20 + i / 8:.3f}\t0.239\r\n" for i in range(12))
HEADER = "Motion Sensor Data File Sep 20, 2018 1:40 PM\r\nTime (s)\tDistance (cm)\tDist Error (cm)\r\n"


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """Write a position file under a suffix that says nothing."""
    path = tmp_path / "run.dat"
    path.write_bytes((HEADER + ROWS).encode())
    return path


def test_a_format_may_be_named(run: Path) -> None:
    """Naming the right one changes nothing; an unknown one is an error that lists the known."""
    assert len(open_recording(run, format="motion-sensor").samples) == 12
    with pytest.raises(UnknownFormat, match="nonsense"):
        open_recording(run, format="nonsense")
