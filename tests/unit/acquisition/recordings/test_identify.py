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
<<<<<<< HEAD


@pytest.mark.parametrize("text", ["0.1 0.2\n0.2 0.3\n0.3 0.4\n", "0,1\t2,5\n0,2\t2,7\n0,3\t2,9\n"])
def test_the_unit_of_bare_numbers_is_never_guessed(tmp_path: Path, text: str) -> None:
    """It is asked for, and what was given is said."""
    path = tmp_path / "run.txt"
    path.write_text(text)
    with pytest.raises(NeedsAnswer) as caught:
        open_recording(path)
    assert caught.value.question.examples == {"unit": "m"}
    recording = open_recording(path, unit="cm")
    assert {"time_unit_assumed", "nominal_clock"} <= {trap.code for trap in recording.traps}
    assert recording.info.rate_hz == 10.0


@pytest.mark.parametrize("content", [b"", bytes(range(256)) * 20, b"Dear diary,\ntoday we hung a mass.\n", b"x" * 9000])
def test_what_is_no_recording_is_refused(tmp_path: Path, content: bytes) -> None:
    """One line with the file's name: an empty file, bytes that are no text, prose, a line without end."""
    path = tmp_path / "run.txt"
    path.write_bytes(content)
    with pytest.raises(FormatError) as caught:
        open_recording(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_absent_files_and_directories_are_refused(tmp_path: Path) -> None:
    """The system's error becomes one line."""
    with pytest.raises(FormatError, match=r"absent\.txt"):
        open_recording(tmp_path / "absent.txt")
    with pytest.raises(FormatError, match="directory"):
        open_recording(tmp_path)
    with pytest.raises(FormatError, match=r"a\\?.0*b"):
        open_recording("a\0b")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_is_refused_without_waiting(tmp_path: Path) -> None:
    """Opening it would wait for a writer that never comes."""
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(FormatError, match="pipe"):
        open_recording(tmp_path / "pipe")
=======
>>>>>>> dietA
