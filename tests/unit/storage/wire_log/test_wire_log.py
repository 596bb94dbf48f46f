"""The wire log: its layout, its header, what is no record of it, and how it is read while it grows."""

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

from acquisition.events import StoredEvent
from storage.errors import WriteFailed
from storage.schema import ValueRefused
from storage.wire_log.appending import WireLogWriter
from storage.wire_log.records import (
    RECORD_HEAD_BYTES,
    LogHeader,
    Record,
    RecordKind,
    SensorEntry,
    event_of,
    event_payload,
    frame,
)
from storage.wire_log.scanning import Scan, read_log
from tests.sampling import sampled
from tests.wire import Disk, append, parse_log

HEADER = LogHeader(
    sensors=(
        SensorEntry(0, "maxbotix", "COM3", 9600, options={"unit": "mm"}),
        SensorEntry(7, "line", "socket://bench:4000", 115200, 100.0, calibration={"scale": 1.01}),
    ),
    mono_ns=5_000_000_000,
    unix_ns=1_500_000_000_123_456_789,
    kind="simulated",
    scene={"bob": {"mass_kg": {"value": 0.2176, "u": 5e-05}}},
    title="Träger",
    version="0.1.0",
)


def test_a_record_lies_in_the_file_as_documented() -> None:
    """The layout of the docstring is the layout of the bytes."""
    record = frame(RecordKind.DATA, b"R0500\r", sequence=2**32 + 7, mono_ns=123, log=0xCAFE, channel=3)
    head = struct.pack("<2sHIqIBBH", b"\xf5\xa9", 6, 7, 123, 0xCAFE, 2, 3, 0)
    assert record == head + struct.pack("<I", zlib.crc32(head + b"R0500\r")) + b"R0500\r"
    assert len(record) == RECORD_HEAD_BYTES + 6 == 34


def test_a_log_that_cannot_be_made_says_why(tmp_path: Path) -> None:
    """A missing folder and a header that JSON cannot hold are one line each and leave nothing."""
    with pytest.raises(WriteFailed, match="could not be made"):
        WireLogWriter(tmp_path / "none" / "run.wire", HEADER)
    odd = LogHeader(sensors=(), mono_ns=0, unix_ns=0, scene={"a": float("nan")})
    with pytest.raises(WriteFailed, match="header cannot be written"):
        WireLogWriter(tmp_path / "run.wire", odd)
    assert not list(tmp_path.iterdir())


def test_the_header_survives_its_first_page() -> None:
    """A log longer than 32 KiB holds the header again."""
    disk = Disk()
    log = WireLogWriter("run.wire", HEADER, open_file=disk)
    while log.written.bytes < 100_000:
        append(log, RecordKind.DATA, bytes(100), mono_ns=0)
    disk.data[:4096] = bytes(4096)
    contents = parse_log(bytes(disk.data))
    assert contents.header == HEADER
    assert not contents.damage.intact


def test_records_of_another_log_are_no_records() -> None:
    """Old disk blocks, or a device that sends a log as its data, add nothing."""
    mine = [frame(RecordKind.DATA, bytes([n]), sequence=n, mono_ns=n, log=1) for n in range(4)]
    foreign = frame(RecordKind.DATA, b"foreign", sequence=2, mono_ns=2, log=2)
    contents = parse_log(mine[0] + mine[1] + foreign + mine[3])
    assert [(record.payload, record.lost_before) for record in contents] == [(b"\0", 0), (b"\1", 0), (b"\3", 1)]
    damage = contents.damage
    assert (damage.skipped_at, damage.skipped_bytes) == (len(mine[0] + mine[1]), len(foreign))
    # The record that carries a record is torn: the carried one stays where it is.
    carrier = frame(RecordKind.DATA, foreign * 3, sequence=2, mono_ns=2, log=1)
    torn = carrier[:-1] + b"?"
    assert [record.payload for record in parse_log(mine[0] + mine[1] + torn + mine[3])] == [b"\0", b"\1", b"\3"]


def test_a_record_that_comes_twice_is_delivered_once() -> None:
    """A number that runs back is an old copy; a number that wraps is not."""
    mine = [frame(RecordKind.DATA, bytes([n]), sequence=n, mono_ns=n, log=1) for n in range(3)]
    contents = parse_log(mine[0] + mine[1] + mine[0] + mine[2])
    assert [record.payload for record in contents] == [b"\0", b"\1", b"\2"]
    assert (contents.damage.strays, contents.damage.lost, contents.damage.intact) == (1, 0, False)
    last = [frame(RecordKind.DATA, b"", sequence=n, mono_ns=0, log=1) for n in (2**31 - 1, 2**32 - 2, 2**32 - 1, 2**32)]
    assert [record.sequence for record in parse_log(b"".join(last))] == [2**31 - 1, 2**32 - 2, 2**32 - 1, 0]


def test_a_header_is_checked() -> None:
    """Channels differ, calibrations are ones that can be, another version is refused, and so is an unknown key."""
    with pytest.raises(ValueRefused, match="sensors"):
        LogHeader(sensors=(SensorEntry(1, "line"), SensorEntry(1, "line")), mono_ns=0, unix_ns=0)
    with pytest.raises(ValueRefused, match="scale"):
        SensorEntry(0, "line", calibration={"scale": 0.0})
    with pytest.raises(ValueRefused, match="got 2"):
        LogHeader.decode(HEADER.encode().replace(b'"log":1', b'"log":2'))
    with pytest.raises(ValueRefused, match="titel"):
        LogHeader.decode(HEADER.encode().replace(b'"title":', b'"titel":'))


def test_an_event_is_told_whatever_its_facts_are() -> None:
    """Facts that JSON cannot hold go in as text: the reading thread must not fail on them."""
    event = StoredEvent("lost", {"why": OSError(5, "gone"), "gap_s": float("nan")})
    assert event_of(event_payload(event)).facts == {"why": "OSError(5, 'gone')", "gap_s": "nan"}


def written(folder: Path) -> bytes:
    """Return a log of 300 reads and an end."""
    log = WireLogWriter(folder / "whole.wire", HEADER, log=7)
    for number in range(300):
        append(log, RecordKind.DATA, b"R%04d\r" % number, mono_ns=number)
    append(log, RecordKind.END, b"{}", mono_ns=400)
    log.close()
    return log.path.read_bytes()


class Follower:
    """Reads what was added to a log."""

    def __init__(self, path: Path) -> None:
        self.log = read_log(path)
        self.scan: Scan = self.log.scan()

    def records(self) -> list[Record]:
        """Return the records that came."""
        return list(self.scan.records(self.log.grow()))


@pytest.mark.parametrize("seed", sampled(range(10), 3))
def test_a_log_that_grows_gives_what_a_reader_finds_at_its_end(tmp_path: Path, seed: int) -> None:
    """Cut anywhere while it grows, damaged or not: the same records, the same losses before them, each once."""
    rng = np.random.default_rng(seed)
    data = bytearray(written(tmp_path))
    start = len(data) // 4
    for at in rng.integers(start, len(data), seed):
        data[at] ^= 1 << int(rng.integers(8))
    path = tmp_path / "run.wire"
    path.write_bytes(data[:start])
    follower = Follower(path)
    came = follower.records()
    for at in [*sorted(rng.integers(start, len(data), 60).tolist()), len(data)]:
        path.write_bytes(data[:at])
        came += follower.records()
    whole = read_log(path)
    assert came == list(whole)
    assert follower.scan.damage == whole.damage
