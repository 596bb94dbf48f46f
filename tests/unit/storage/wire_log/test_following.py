"""A log is read while it is written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from storage.wire_log.appending import WireLogWriter
from storage.wire_log.following import LogFollower
from storage.wire_log.records import Kind, LogHeader, SensorEntry, frame
from storage.wire_log.scanning import NotALog, read_log
from tests.sampling import sampled

HEADER = LogHeader(sensors=(SensorEntry(0, "maxbotix-hr"),), mono_ns=0, unix_ns=0, kind="simulated")


def payloads(follower: LogFollower) -> list[bytes]:
    """Return the reads that came."""
    return [record.payload for record in follower.records() if record.kind is Kind.DATA]


def test_every_record_comes_once_as_soon_as_it_is_whole(tmp_path: Path) -> None:
    """Also past a copy of the header, which is left out."""
    log = WireLogWriter(tmp_path / "run.wire", HEADER)
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
    follower.close()
    log.close()


def written(folder: Path) -> bytes:
    """Return a log of 300 reads and an end."""
    log = WireLogWriter(folder / "whole.wire", HEADER, log=7)
    for number in range(300):
        log.append(Kind.DATA, b"R%04d\r" % number, mono_ns=number)
    log.append(Kind.END, b"{}", mono_ns=400)
    log.close()
    return log.path.read_bytes()


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
    follower = LogFollower(path)
    came = follower.records()
    for at in [*sorted(rng.integers(start, len(data), 60).tolist()), len(data)]:
        path.write_bytes(data[:at])
        came += follower.records()
    follower.close()
    assert came == [record for record in read_log(path) if record.kind is not Kind.HEADER]
    assert follower.ended == read_log(path).damage.ended


def test_half_a_record_waits_and_damage_is_passed_over(tmp_path: Path) -> None:
    """A torn end may still be written; behind bytes that are no record the next one comes, as by any reader."""
    path = tmp_path / "run.wire"
    whole = written(tmp_path)
    path.write_bytes(whole[:-3])
    follower = LogFollower(path)
    assert len(payloads(follower)) == 300
    path.write_bytes(whole)
    assert [record.kind for record in follower.records()] == [Kind.END]
    count = read_log(path).damage.records
    path.write_bytes(whole + b"damaged" + frame(Kind.DATA, b"late", sequence=count + 2, mono_ns=500, log=7))
    (late,) = follower.records()
    assert (late.payload, late.lost_before) == (b"late", 2)
    follower.close()


@pytest.mark.parametrize("content", [None, b"", b"time distance\n"])
def test_what_is_no_log_is_refused(tmp_path: Path, content: bytes | None) -> None:
    """In one line."""
    path = tmp_path / "run.wire"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(NotALog, match=r"cannot be read|expected a wire log"):
        LogFollower(path)
