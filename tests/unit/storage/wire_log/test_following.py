"""A log is read while it is written."""

from __future__ import annotations

from pathlib import Path

import pytest

from storage.wire_log.appending import Roll, WireLogWriter
from storage.wire_log.following import LogFollower
from storage.wire_log.records import Kind, LogHeader, SensorEntry
from storage.wire_log.window import LONGEST, NotALog

HEADER = LogHeader(sensors=(SensorEntry(0, "maxbotix-hr"),), mono_ns=0, unix_ns=0, kind="simulated")


def payloads(follower: LogFollower) -> list[bytes]:
    """Return the reads that came."""
    return [record.payload for record in follower.records() if record.kind is Kind.DATA]


@pytest.mark.parametrize("roll", [Roll(), Roll(bytes=1500)])
def test_every_record_comes_once_as_soon_as_it_is_whole(tmp_path: Path, roll: Roll) -> None:
    """Also where the log goes on in further files, one of whose names somebody has taken."""
    (tmp_path / "run.002.wire").write_bytes(b"mine")
    log = WireLogWriter(tmp_path / "run.wire", HEADER, roll=roll)
    follower = LogFollower(tmp_path / "run.wire")
    assert follower.header == HEADER
    for number in range(300):
        log.append(Kind.DATA, b"R%04d\r" % number, mono_ns=number)
        assert payloads(follower) == [b"R%04d\r" % number]
    assert payloads(follower) == []
    assert not follower.ended
    log.append(Kind.END, b"{}", mono_ns=400)
    assert [record.kind for record in follower.records()] == [Kind.END]
    assert follower.ended
    assert roll == Roll() or len(list(tmp_path.iterdir())) > 4
    follower.close()
    log.close()


def test_what_the_log_holds_already_comes_too(tmp_path: Path) -> None:
    """Whoever looks late misses nothing."""
    log = WireLogWriter(tmp_path / "run.wire", HEADER)
    for number in range(100):
        log.append(Kind.DATA, b"R%04d\r" % number, mono_ns=number)
    follower = LogFollower(tmp_path / "run.wire")
    assert payloads(follower) == [b"R%04d\r" % number for number in range(100)]
    follower.close()
    log.close()


def test_a_long_mark_is_put_together(tmp_path: Path) -> None:
    """From the records that it was split into."""
    log = WireLogWriter(tmp_path / "run.wire", HEADER)
    follower = LogFollower(tmp_path / "run.wire")
    log.append(Kind.MARK, b"x" * 150_000, mono_ns=1)
    (mark,) = follower.records()
    assert mark.text() == "x" * 150_000
    follower.close()
    log.close()


def test_half_a_record_waits_and_damage_is_one_line(tmp_path: Path) -> None:
    """A torn end may still be written; bytes that are no record are said."""
    path = tmp_path / "run.wire"
    log = WireLogWriter(path, HEADER)
    log.append(Kind.DATA, b"R0001\r", mono_ns=1)
    log.close()
    whole = path.read_bytes()
    path.write_bytes(whole[:-3])
    follower = LogFollower(path)
    assert payloads(follower) == []
    path.write_bytes(whole)
    assert payloads(follower) == [b"R0001\r"]
    path.write_bytes(whole + bytes(LONGEST))
    with pytest.raises(NotALog, match=f"at byte {len(whole)}, got damaged bytes"):
        follower.records()
    follower.close()


@pytest.mark.parametrize("content", [None, b"", b"time distance\n"])
def test_what_is_no_log_is_refused(tmp_path: Path, content: bytes | None) -> None:
    """In one line."""
    path = tmp_path / "run.wire"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(NotALog, match="was demanded"):
        LogFollower(path)
