"""A log is read while it is written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from storage.wire_log.appending import WireLogWriter
from storage.wire_log.records import Kind, LogHeader, Record, SensorEntry, frame
from storage.wire_log.scanning import Scan, read_log
from tests.sampling import sampled
from tests.wire import append

HEADER = LogHeader(sensors=(SensorEntry(0, "maxbotix-hr"),), mono_ns=0, unix_ns=0, kind="simulated")


def written(folder: Path) -> bytes:
    """Return a log of 300 reads and an end."""
    log = WireLogWriter(folder / "whole.wire", HEADER, log=7)
    for number in range(300):
        append(log, Kind.DATA, b"R%04d\r" % number, mono_ns=number)
    append(log, Kind.END, b"{}", mono_ns=400)
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


def test_half_a_record_waits_and_damage_is_passed_over(tmp_path: Path) -> None:
    """A torn end may still be written; behind bytes that are no record the next one comes, as by any reader."""
    path = tmp_path / "run.wire"
    whole = written(tmp_path)
    path.write_bytes(whole[:-3])
    follower = Follower(path)
    assert len(follower.records()) == 301
    path.write_bytes(whole)
    assert [record.kind for record in follower.records()] == [Kind.END]
    count = read_log(path).damage.records
    path.write_bytes(whole + b"damaged" + frame(Kind.DATA, b"late", sequence=count + 2, mono_ns=500, log=7))
    (late,) = follower.records()
    assert (late.payload, late.lost_before) == (b"late", 2)
