"""Logs of version 0.1.0 that went on in further files read as one; this version writes one file."""

from __future__ import annotations

from pathlib import Path

from springmass.cli import main
from storage.recovery.recover import recover, verify_against_log
from storage.run_file.reading import open_run
from storage.wire_log.appending import WireLogWriter
from storage.wire_log.following import LogFollower
from storage.wire_log.records import Kind, LogHeader, SensorEntry, frame
from storage.wire_log.scanning import read_log

HEADER = LogHeader(sensors=(SensorEntry(0, "maxbotix-hr"),), mono_ns=0, unix_ns=0, kind="simulated")
READS = [b"R%04d\r" % (300 + number) for number in range(400)]
LOG = 11


def write(path: Path, numbers: tuple[int, ...] = (0, 1, 2, 3)) -> list[Path]:
    """Write a log of 400 reads, ten milliseconds apart, in files of these numbers, each begun with the header."""
    items = [(Kind.DATA, data) for data in READS]
    sequence, files = 0, []
    for place, number in enumerate(numbers):
        mine = items[place * 100 : (place + 1) * 100] + ([(Kind.END, b"{}")] if place == len(numbers) - 1 else [])
        records = []
        for kind, payload in [(Kind.HEADER, HEADER.encode()), *mine]:
            records.append(frame(kind, payload, sequence, sequence * 10_000_000, LOG))
            sequence += 1
        files.append(path.with_name(f"{path.stem}.{number:03d}{path.suffix}") if number else path)
        files[-1].write_bytes(b"".join(records))
    return files


def payloads(path: Path) -> list[bytes]:
    """Return the reads that a log holds."""
    return [record.payload for record in read_log(path) if record.kind is Kind.DATA]


def test_a_log_in_parts_is_one_log(tmp_path: Path) -> None:
    """No read is lost between two files, and all of them together are sound."""
    files = write(tmp_path / "run.wire")
    contents = read_log(tmp_path / "run.wire")
    assert [part.path for part in contents.parts] == files
    assert payloads(tmp_path / "run.wire") == READS
    assert (contents.damage.intact, contents.damage.ended) == (True, True)
    assert contents.size == sum(path.stat().st_size for path in files)


def test_a_log_in_parts_becomes_one_run_and_goes_as_a_whole(tmp_path: Path) -> None:
    """The run file holds every file of the log under its name; removed are all of them, and only after that."""
    whole = {path.name: path.read_bytes() for path in write(tmp_path / "run.wire")}
    report = recover(tmp_path / "run.wire")
    verify_against_log(report.runs[0].path, tmp_path / "run.wire")
    assert list(report.describe())[-1].endswith("records in 4 files")
    with open_run(tmp_path / "run.h5") as run:
        run.verify()
        assert len(run) == 400
        assert {original.name: original.data for original in run.originals()} == whole
    assert recover(tmp_path / "run.wire", remove_log=True).log_removed
    assert [path.name for path in tmp_path.iterdir()] == ["run.h5"]


def test_a_log_in_parts_is_recovered_and_analysed_by_the_program(tmp_path: Path) -> None:
    """The command reads it by its first file, as it always did."""
    write(tmp_path / "run.wire")
    assert main(["recover", str(tmp_path / "run.wire")]) == 0
    with open_run(tmp_path / "run.h5") as run:
        assert (len(run), run.provenance["log"]["lost"]) == (400, 0)


def test_a_file_of_another_log_is_left_alone(tmp_path: Path) -> None:
    """A recording that is called like a further file of another is neither read as one nor removed."""
    second = WireLogWriter(tmp_path / "run.001.wire", HEADER)
    second.append(Kind.DATA, b"R9999\r", mono_ns=1)
    second.close()
    before = (tmp_path / "run.001.wire").read_bytes()
    write(tmp_path / "run.wire", (0, 2, 3, 4))
    assert [part.path.name for part in read_log(tmp_path / "run.wire").parts][:2] == ["run.wire", "run.002.wire"]
    assert payloads(tmp_path / "run.wire") == READS
    assert recover(tmp_path / "run.wire", remove_log=True).log_removed
    assert (tmp_path / "run.001.wire").read_bytes() == before


def test_a_lost_file_of_a_log_is_counted(tmp_path: Path) -> None:
    """Records of a file that is gone are missing by their numbers; what the others hold is there."""
    files = write(tmp_path / "run.wire")
    files[1].unlink()
    contents = read_log(tmp_path / "run.wire")
    assert payloads(tmp_path / "run.wire") == READS[:100] + READS[200:]
    assert contents.damage.lost == 101


def test_a_follower_reads_a_log_in_parts(tmp_path: Path) -> None:
    """From its first file on to the last."""
    write(tmp_path / "run.wire")
    follower = LogFollower(tmp_path / "run.wire")
    assert [record.payload for record in follower.records() if record.kind is Kind.DATA] == READS
    assert follower.ended
    follower.close()
