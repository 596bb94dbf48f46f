"""The registry: formats by content, helpful refusals, and files that cannot be opened."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquisition.errors import UnknownFormat
from acquisition.recordings.identify import open_recording, sniff

ROWS = "".join(f"{i / 100:.3f}\t{20 + i / 8:.3f}\t0.239\r\n" for i in range(12))
HEADER = "Motion Sensor Data File Sep 20, 2018 1:40 PM\r\nTime (s)\tDistance (cm)\tDist Error (cm)\r\n"


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """Write a position file under a suffix that says nothing."""
    path = tmp_path / "run.dat"
    path.write_bytes((HEADER + ROWS).encode())
    return path


def test_a_file_is_told_by_content(run: Path) -> None:
    """The suffix does not matter."""
    assert sniff(run) == "motion-sensor"
    recording = open_recording(run)
    assert (recording.format, recording.info.name, recording.path) == ("motion-sensor", "run.dat", str(run))
    assert recording.originals[0].data == run.read_bytes()


def test_a_format_may_be_named(run: Path) -> None:
    """Naming the right one changes nothing; an unknown one is an error that lists the known."""
    assert len(open_recording(run, format="motion-sensor").samples) == 12
    with pytest.raises(UnknownFormat, match="nonsense"):
        open_recording(run, format="nonsense")


@pytest.mark.parametrize(
    ("head", "title"), [(b"\x89HDF\r\n\x1a\n" + bytes(99), "HDF5"), (b"\0\0\0\x20ftypisom" + bytes(99), "video")]
)
def test_what_is_not_read_is_named_with_what_to_do(tmp_path: Path, head: bytes, title: str) -> None:
    """HDF5 and video are recognised by content, whatever the file is called."""
    path = tmp_path / "run.csv"
    path.write_bytes(head)
    with pytest.raises(UnknownFormat) as caught:
        open_recording(path)
    assert title in caught.value.problem
    assert caught.value.remedy
    assert "\n" not in str(caught.value)
