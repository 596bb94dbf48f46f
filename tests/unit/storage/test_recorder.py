"""The recorder: the reading thread never waits, and what is not recorded is told."""

import errno

import pytest

from acquisition.clock import VirtualClock
from acquisition.events import StoredEvent
from storage.errors import WriteFailed
from storage.recorder import Recorder
from storage.wire_log.records import LogHeader, RecordKind, SensorEntry
from tests.wire import WAIT_S, Disk, json_of, parse_log

HEADER = LogHeader(sensors=(SensorEntry(0, "line"), SensorEntry(1, "line")), mono_ns=0, unix_ns=0)
HOUR_S = 3600.0


def recorder(disk: Disk, *, sync_every_s: float = HOUR_S, queue_bytes: int = 1 << 20) -> Recorder:
    """Return a recorder to a file in memory."""
    return Recorder(
        "run.wire", HEADER, VirtualClock(7), sync_every_s=sync_every_s, queue_bytes=queue_bytes, open_file=disk
    )


def test_a_slow_sync_holds_up_no_write() -> None:
    """Records are appended while fdatasync hangs, so a kill in that time loses none of them."""
    disk = Disk()
    recording = recorder(disk, sync_every_s=1e-4)
    disk.syncs_pass.clear()
    recording.reads([(0, 0, b"first")])
    assert disk.held.wait(WAIT_S)
    for number in range(100):
        recording.reads([(0, number, b"x")])
    status = recording.drain()
    assert (status.records, status.synced_records) == (102, 1)
    disk.syncs_pass.set()
    recording.close()
    assert recording.status.synced_records == recording.status.records == 103
    assert "springmass-sync" in disk.threads["sync"]
    assert "springmass-log" not in disk.threads["sync"]


def test_events_and_marks_outlast_an_overflow() -> None:
    """All of them are in the log, and the reads that were lost among them are counted."""
    disk = Disk()
    recording = recorder(disk, queue_bytes=200)
    disk.writes_pass.clear()
    recording.reads([(0, 0, b"first")])
    assert disk.held.wait(WAIT_S)
    for number in range(1, 20):
        recording.reads([(0, number, b"x" * 10)])
        recording.event(0, number, StoredEvent("lost", {"number": number}))
    recording.mark("now", host_ns=20)
    disk.writes_pass.set()
    recording.drain()
    recording.reads([(0, 21, b"after")])
    recording.close()
    _, _, *records, after, _ = list(parse_log(bytes(disk.data)))
    events = [json_of(record) for record in records if record.kind is RecordKind.EVENT]
    assert [event["facts"]["number"] for event in events if event["kind"] == "lost"] == list(range(1, 20))
    assert [record.text() for record in records if record.kind is RecordKind.MARK] == ["now"]
    assert after.payload == b"after"
    (overflow,) = [event for event in events if event["kind"] == "overflow"]
    recorded = sum(record.kind is RecordKind.DATA for record in records)
    assert recorded + overflow["facts"]["records"] == 19 == recorded + recording.status.dropped_records


def test_a_read_longer_than_a_record_is_divided() -> None:
    """A record has 65535 bytes at most."""
    disk, long = Disk(), bytes(range(256)) * 1000
    recording = recorder(disk)
    recording.reads([(1, 5, long)])
    recording.close()
    records = [record for record in parse_log(bytes(disk.data)) if record.kind is RecordKind.DATA]
    assert b"".join(record.payload for record in records) == long
    assert {(record.channel, record.mono_ns) for record in records} == {(1, 5)}


def test_what_a_full_disk_took_is_synced_at_once() -> None:
    """Nobody may come to close a recording that stopped: what it has goes to the disk without waiting."""
    disk = Disk()
    recording = recorder(disk)
    disk.room = len(disk.data) + 100
    disk.syncs_pass.clear()
    for number in range(10):
        recording.reads([(0, number, b"x")])
    assert disk.held.wait(WAIT_S)
    assert recording.status.error
    disk.syncs_pass.set()
    with pytest.raises(WriteFailed):
        recording.close()


def test_a_failed_sync_stops_the_recording() -> None:
    """Records that may never reach the disk must not look safe."""
    disk = Disk()
    recording = recorder(disk)
    recording.reads([(0, 0, b"x")])
    assert recording.drain(sync=True).synced_records == 2
    disk.sync_trouble = OSError(errno.EIO, "Input/output error")
    recording.reads([(0, 1, b"y")])
    status = recording.drain(sync=True)
    assert "could not be synced to the disk (Input/output error)" in status.error
    assert (status.records, status.synced_records) == (3, 2)
    with pytest.raises(WriteFailed, match="could not be synced"):
        recording.close()
    assert recording.status.synced_records == 2
