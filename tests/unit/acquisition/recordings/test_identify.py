"""The registry: formats by content, helpful refusals, and files that cannot be opened."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from acquisition.errors import AcquisitionError, FormatError, NeedsAnswer, UnknownFormat
from acquisition.recordings import identify as registry
from acquisition.recordings.identify import formats, get_format, inspect, open_recording, sniff
from acquisition.recordings.questions import Missing

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
    with pytest.raises(UnknownFormat, match=r'"nonsense".*motion-sensor'):
        open_recording(run, format="nonsense")


def test_velocity_is_joined(run: Path, tmp_path: Path) -> None:
    """A velocity file named beside the position makes one recording."""
    velocity = tmp_path / "v.txt"
    velocity.write_text("Time (s)\tVelocity (cm/s)\n0.000\tNaN\n0.010\t12.500\n0.020\t12.500\n")
    recording = open_recording(run, velocity_path=velocity)
    assert recording.samples.velocity is not None
    assert recording.samples.velocity[1:3].tolist() == [0.125, 0.125]


def test_every_listed_format_has_a_name_and_a_title() -> None:
    """The listing is what the table says."""
    assert all(get_format(each.name) is each and each.title for each in formats())


def test_importing_the_registry_imports_no_format() -> None:
    """A format costs nothing until it is asked."""
    code = (
        "import sys, acquisition; print([m for m in sys.modules if m.startswith('acquisition.recordings.families.m')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("head", "family"),
    [
        (b"TDSm\x0e\0\0\0" + bytes(99), "tdms"),
        (b"LabVIEW Measurement\t\r\nWriter_Version\t2\r\n", "lvm"),
        (b"Vernier Format 2\nUntitled.cmbl\n", "vernier"),
        (b"Latest: Time (s),Latest: Position (m)\n0,0.5\n", "logger-pro"),
        (b'"Time (s)","Acceleration x (m/s^2)"\n0.0E0,1.4E-2\n', "phyphox"),
        (b'<?xml version="1.0" encoding="UTF-8"?>\n<!-- saved --><phyphox version="1.7">', "phyphox"),
        (b'\xef\xbb\xbf"Position (mm) Run #1";"Position (mm) Run #2"\r\n-19,66;-14,95\r\n', "capstone"),
        (b'"Zeit (s) Durchgang #1";"Ort (m) Durchgang #1"\r\n0,1;0,2\r\n', "capstone"),
        ("时间;位置;速度\r\n0.1;0.2;0.3\r\n".encode(), "capstone"),
        (b"time;position;velocity;acceleration\r\n1.0000;0.4788;0.2900;-4.3317\r\n", "capstone"),
        (b"Voltage, ChA, Run #1\r\nTime ( s )\tVoltage ( V )\r\n0.0\t-0.009\r\n", "datastudio"),
        ("质量_A,,,\nt,x,y,rad\n5.68,36.8,-3.8,-1.4\n".encode(), "tracker"),
        (b"t\tx\ty\n0.000\t1.0\t2.0\n", "tracker"),
        ("Tempo (s)\tPosizione (m)\n0,1\t0,2\n".encode("cp1252"), "csv"),
        ("Zeit (s);Länge (m)\n0,1;0,2\n".encode("utf-16"), "csv"),
        (b"0.1 0.2\n0.2 0.3\n0.3 0.4\n", "bare"),
        (b"1,5;2,5\n1,6;2,7\n", "bare"),
        (b"0.1\n0.2\n", "bare"),
        (b"0 1 2\n1 4 9\n2 9 1\n", "bare"),
    ],
)
def test_every_family_is_told_by_content(tmp_path: Path, head: bytes, family: str) -> None:
    """By the signatures of the wild, under a suffix that says something else."""
    path = tmp_path / "run.xlsx"
    path.write_bytes(head)
    assert sniff(path) == family
    assert get_format(family).evidence(head)  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("head", "title"),
    [
        (b"\x89HDF\r\n\x1a\n" + bytes(99), "HDF5"),
        (
            b"PK\x03\x04" + bytes(26) + b"mimetypeapplication/vnd.oasis.opendocument.spreadsheet",
            "OpenDocument",
        ),
        (b"MATLAB 5.0 MAT-file, Platform" + bytes(99), "MATLAB"),
        (b"\0\0\0\x20ftypisom" + bytes(99), "video"),
        (b"TDSh" + bytes(99), "TDMS index"),
    ],
)
def test_what_is_not_read_is_named_with_what_to_do(tmp_path: Path, head: bytes, title: str) -> None:
    """By content, whatever it is called."""
    path = tmp_path / "run.csv"
    path.write_bytes(head)
    with pytest.raises(UnknownFormat) as caught:
        open_recording(path)
    assert title in caught.value.problem
    assert caught.value.remedy
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "head", "title"),
    [
        ("run.cap", b"PK\x03\x04" + bytes(99), "Capstone"),
        ("run.spklab", bytes(range(256)) * 9, "SPARKvue"),
        ("run.opj", bytes.fromhex("d0cf11e0a1b11ae1") + bytes(999), "Origin"),
    ],
)
def test_a_program_s_file_is_named_with_how_to_export_it(tmp_path: Path, name: str, head: bytes, title: str) -> None:
    """Where the first bytes say too little, the suffix tells; also of a zip or an OLE file without sheets."""
    path = tmp_path / name
    path.write_bytes(head)
    with pytest.raises(UnknownFormat) as caught:
        open_recording(path)
    assert title in caught.value.problem
    assert title in caught.value.remedy
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["0.1 0.2\n0.2 0.3\n0.3 0.4\n", "0,1\t2,5\n0,2\t2,7\n0,3\t2,9\n"])
def test_the_unit_of_bare_numbers_is_never_guessed(tmp_path: Path, text: str) -> None:
    """It is asked for, and what was given is said."""
    path = tmp_path / "run.txt"
    path.write_text(text)
    with pytest.raises(NeedsAnswer) as caught:
        open_recording(path)
    assert caught.value.question.examples == {"unit": "m"}
    recording = open_recording(path, unit="cm")
    assert {"unit_assumed", "nominal_clock"} <= {trap.code for trap in recording.traps}
    assert recording.info.rate_hz == 10.0


def test_the_rate_and_the_channel_of_bare_numbers_are_never_guessed(tmp_path: Path) -> None:
    """One column has no times; of three columns the user takes one; row numbers are no times."""
    path = tmp_path / "run.txt"
    path.write_text("2.5\n2.6\n2.7\n")
    with pytest.raises(NeedsAnswer) as caught:
        open_recording(path, unit="cm")
    assert caught.value.question.missing == (Missing.RATE_HZ,)
    recording = open_recording(path, unit="cm", rate_hz=50.0)
    assert recording.samples.t.tolist() == [0.0, 0.02, 0.04]
    assert {"rate_given", "unit_given"} <= {trap.code for trap in recording.traps}
    path.write_text("0 1 2\n1 4 9\n2 9 1\n3 7 5\n")
    with pytest.raises(NeedsAnswer) as caught:
        open_recording(path, unit="cm", rate_hz=50.0)
    (need,) = caught.value.question.needs
    assert (need.what, need.choices, need.example) == (Missing.CHANNEL, ("column 2", "column 3"), "column 2")
    recording = open_recording(path, unit="cm", rate_hz=50.0, channel="column 3")
    assert recording.samples.distance.tolist() == [0.02, 0.09, 0.01, 0.05]


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


def test_a_file_without_read_permission_is_refused(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The reason is the system's own."""

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("builtins.open", refuse)
    with pytest.raises(FormatError, match="Permission denied"):
        open_recording(run)


@pytest.mark.parametrize("start", [b"", HEADER.encode()])
def test_a_gigabyte_of_one_line_is_not_read(tmp_path: Path, start: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    """A line of more than a MiB ends the reading, wherever it begins."""
    path = tmp_path / "run.txt"
    path.write_bytes(start + b"0.010\t25.6")
    os.truncate(path, 1 << 30)
    with pytest.raises(FormatError):
        open_recording(path)


def test_the_first_line_beyond_a_mib_is_named(tmp_path: Path) -> None:
    """Where the long line begins is said as nearly as chunks can tell."""
    path = tmp_path / "run.txt"
    path.write_bytes((HEADER + ROWS).encode() + b"1" * (3 << 20))
    with pytest.raises(FormatError, match="1 MiB") as caught:
        open_recording(path)
    assert caught.value.line == 15


class Extra:
    """A format from elsewhere."""

    name, title = "extra", "recordings of another bench"

    def recognises(self, head: bytes) -> bool:
        """Know the bench's magic."""
        return head.startswith(b"EXTRA")


EXTRA = Extra()


def install(monkeypatch: pytest.MonkeyPatch, value: str) -> None:
    """Pretend that a package brings an entry point."""
    entry = EntryPoint("extra", value, registry.GROUP)
    monkeypatch.setattr(registry, "_entry_points", lambda: {"extra": entry})


def test_an_entry_point_adds_a_format(run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is listed, recognised and found by name, after those of the table and before the one that takes any."""
    monkeypatch.setitem(sys.modules, "extra_bench", sys.modules[__name__])
    monkeypatch.setattr(EntryPoint, "load", lambda _: EXTRA)
    install(monkeypatch, "extra_bench:EXTRA")
    path = tmp_path / "other.bin"
    path.write_bytes(b"EXTRA 1")
    assert sniff(path) == "extra"
    assert get_format("extra") is EXTRA
    assert [each.name for each in formats()][-2:] == ["extra", "table"]
    assert inspect(path).surveys == ()
    assert inspect(path).why == ""
    assert sniff(run) == "motion-sensor"


def test_a_broken_entry_point_is_named_and_only_when_needed(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A package that cannot be imported spoils nothing that the table can read."""
    install(monkeypatch, "no_such_module_at_all:FORMAT")
    assert sniff(run) == "motion-sensor"
    with pytest.raises(AcquisitionError, match=r'"extra" \(no_such_module_at_all:FORMAT\)'):
        formats()
