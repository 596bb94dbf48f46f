"""Long logs go on in further files, and read as one."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from storage.errors import WriteFailed
from storage.recovery.recover import recover, verify_against_log
from storage.run_file.reading import open_run
from storage.wire_log.appending import LogFile, Roll, WireLogWriter, open_log_file
from storage.wire_log.records import Kind, LogHeader, SensorEntry
from storage.wire_log.scanning import read_log

HEADER = LogHeader(sensors=(SensorEntry(0, "maxbotix-hr"),), mono_ns=0, unix_ns=0, kind="simulated")
READS = [b"R%04d\r" % (300 + number) for number in range(400)]


def write(path: Path, roll: Roll) -> WireLogWriter:
    """Write a log of 400 reads, ten milliseconds apart."""
    log = WireLogWriter(path, HEADER, roll=roll)
    for number, data in enumerate(READS):
        log.append(Kind.DATA, data, mono_ns=number * 10_000_000)
    log.append(Kind.END, b"{}", mono_ns=4_000_000_000)
    log.close()
    return log


def payloads(path: Path) -> list[bytes]:
    """Return the reads that a log holds."""
    return [record.payload for record in read_log(path) if record.kind is Kind.DATA]


@pytest.mark.parametrize("roll", [Roll(bytes=4000), Roll(ns=1_000_000_000), Roll(bytes=9000, ns=1_500_000_000)])
def test_a_long_log_lies_in_files_that_are_one_log(roll: Roll, tmp_path: Path) -> None:
    """No read is lost between two files; each begins with the header, and all of them together are sound."""
    log = write(tmp_path / "run.wire", roll)
    files = sorted(path.name for path in tmp_path.iterdir())
    assert len(files) >= 3
    assert set(files) == {"run.wire", *(f"run.{number:03d}.wire" for number in range(1, len(files)))}
    contents = read_log(tmp_path / "run.wire")
    assert payloads(tmp_path / "run.wire") == READS
    assert contents.damage.intact
    assert contents.damage.ended
    assert contents.size == log.written.bytes == sum(path.stat().st_size for path in tmp_path.iterdir())
    assert all(LogHeader.decode(next(iter(read_log(path))).payload) == HEADER for path in tmp_path.iterdir())


def test_a_long_log_becomes_one_run_and_goes_as_a_whole(tmp_path: Path) -> None:
    """The run file holds every file of the log under its name; removed are all of them, and only after that."""
    write(tmp_path / "run.wire", Roll(bytes=6000))
    parts = read_log(tmp_path / "run.wire").parts
    whole = {part.path.name: part.path.read_bytes() for part in parts}
    report = recover(tmp_path / "run.wire")
    verify_against_log(report.runs[0].path, tmp_path / "run.wire")
    assert list(report.describe())[-1].endswith(f"records in {len(parts)} files")
    with open_run(tmp_path / "run.h5") as run:
        run.verify()
        assert len(run) == 400
        assert {original.name: original.data for original in run.originals()} == whole
    assert recover(tmp_path / "run.wire", remove_log=True).log_removed
    assert [path.name for path in tmp_path.iterdir()] == ["run.h5"]


def test_a_file_of_another_log_is_left_alone(tmp_path: Path) -> None:
    """A recording that is called like a further file of another is neither written over, read as one nor removed."""
    other = WireLogWriter(tmp_path / "run.001.wire", HEADER)
    other.append(Kind.DATA, b"R9999\r", mono_ns=1)
    other.close()
    before = (tmp_path / "run.001.wire").read_bytes()
    write(tmp_path / "run.wire", Roll(bytes=6000))
    assert [part.path.name for part in read_log(tmp_path / "run.wire").parts][:2] == ["run.wire", "run.002.wire"]
    assert payloads(tmp_path / "run.wire") == READS
    assert recover(tmp_path / "run.wire", remove_log=True).log_removed
    assert (tmp_path / "run.001.wire").read_bytes() == before


def test_a_lost_file_of_a_long_log_is_counted(tmp_path: Path) -> None:
    """Records of a file that is gone are missing by their numbers; what the others hold is there."""
    write(tmp_path / "run.wire", Roll(bytes=6000))
    gone = [record for record in read_log(tmp_path / "run.001.wire") if record.kind is Kind.DATA]
    count = read_log(tmp_path / "run.001.wire").damage.records
    (tmp_path / "run.001.wire").unlink()
    contents = read_log(tmp_path / "run.wire")
    assert [record.payload for record in contents if record.kind is Kind.DATA] == [
        data for data in READS if data not in {record.payload for record in gone}
    ]
    assert contents.damage.lost == count


def test_where_no_file_can_be_made_the_old_one_goes_on(tmp_path: Path) -> None:
    """A folder that takes no further file ends no recording: nothing is lost, and an event says why."""

    def open_file(path: Path) -> LogFile:
        if path.name != "run.wire":
            raise OSError(errno.EACCES, os.strerror(errno.EACCES))
        return open_log_file(path)

    log = WireLogWriter(tmp_path / "run.wire", HEADER, roll=Roll(bytes=6000), open_file=open_file)
    for number, data in enumerate(READS):
        log.append(Kind.DATA, data, mono_ns=number)
    log.close()
    assert payloads(tmp_path / "run.wire") == READS
    events = [record.json() for record in read_log(tmp_path / "run.wire") if record.kind is Kind.EVENT]
    assert events[0] == {"kind": "roll_failed", "facts": {"why": "[Errno 13] Permission denied", "files": 1}}


def test_a_file_that_does_not_reach_the_disk_ends_the_log(tmp_path: Path) -> None:
    """The next file is begun only when the one before is on the disk; what had come before stands."""

    class Refusing:
        def __init__(self, file: LogFile) -> None:
            self.write, self.close = file.write, file.close
            self.file, self.syncs = file, 0

        def sync(self) -> None:
            self.syncs += 1
            if self.syncs > 1:
                raise OSError(errno.EIO, os.strerror(errno.EIO))
            self.file.sync()

    log = WireLogWriter(
        tmp_path / "run.wire", HEADER, roll=Roll(bytes=6000), open_file=lambda path: Refusing(open_log_file(path))
    )
    with pytest.raises(WriteFailed, match="could not be synced"):
        log.extend((Kind.DATA, 0, number, data) for number, data in enumerate(READS))
    log.close()
    assert payloads(tmp_path / "run.wire") == READS[: len(payloads(tmp_path / "run.wire"))]
    assert not (tmp_path / "run.001.wire").exists()
