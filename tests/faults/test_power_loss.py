"""Power loss: pages that were never synced come back as zeros, as old blocks or not at all; no value is wrong.

No process and no plug is needed: a file in memory notes how far it was at each sync, and a seeded disk then keeps what
was synced and does what it likes with every page after that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.block import F8, I8, Block
from acquisition.readings import Read
from acquisition.source import SourceInfo
from storage.wire_log.appending import Kind, LogHeader, SensorEntry, WireLogWriter, parse_log
from storage.wire_log.wire_samples import decode_log

PAGE = 4096
SENSOR = SensorEntry(0, "maxbotix", "COM3", 57600)
HEADER = LogHeader(sensors=(SENSOR,), mono_ns=0, unix_ns=0)


class Disk:
    """A file in memory that notes how far it was at each sync."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.synced: list[int] = []

    def __call__(self, path: Path) -> Disk:
        """Open."""
        return self

    def write(self, data: bytes | memoryview) -> int:
        """Take all."""
        self.data += data
        return len(data)

    def sync(self) -> None:
        """Note how far the file is."""
        self.synced.append(len(self.data))

    def close(self) -> None:
        """Nothing is held."""


class Frames:
    """Chains of a sensor that sends ``R1234\\r``: no checksum, so that halves of two frames would make a value."""

    def __init__(self) -> None:
        self.each = (self,)
        self._held = b""
        self._blocks: list[tuple[int, Block]] = []
        self._next = 0

    def take(self, reads: Sequence[Read]) -> None:
        """Make samples of the frames that each read completes."""
        for number, host_ns, data in reads:
            # After a break half a frame is forgotten; what is left of it on the other side has no R.
            *lines, self._held = (self._held + data).split(b"\r") if data else [b""]
            values = [int(line[1:]) for line in lines if len(line) == 5 and line[:1] == b"R"]
            n = len(values)
            t = np.arange(self._next, self._next + n) / 100
            distance, flags = np.array(values, np.float64), np.zeros(n, np.uint8)
            self._blocks.append((number, Block(self._next, t, distance, flags, np.full(n, host_ns))))
            self._next += n

    def blocks(self) -> list[tuple[int, Block]]:
        """Return the samples since the last call."""
        blocks, self._blocks = self._blocks, []
        return blocks

    def info(self, name: str, kind: str = "live") -> SourceInfo:
        """Return what is known."""
        return SourceInfo("simulated", name, 100.0)

    def report(self, t: F8, host_ns: I8) -> Mapping[str, Any]:
        """Return nothing of note."""
        return {}


def recording(seed: int, log: int) -> tuple[Disk, dict[int, list[float]]]:
    """Return a file with its syncs, and the values that each read completes, by its time."""
    rng = np.random.default_rng(seed)
    disk = Disk()
    writer = WireLogWriter("run.wire", HEADER, open_file=disk, log=log)
    values = rng.integers(0, 10_000, 600)
    stream = b"".join(b"R%04d\r" % value for value in values)
    truth: dict[int, list[float]] = {}
    at = done = 0
    read = 0
    while at < len(stream):
        read += 1
        size = int(rng.integers(1, 12))
        writer.append(Kind.DATA, stream[at : at + size], mono_ns=read)
        at = min(at + size, len(stream))
        truth[read] = [float(value) for value in values[done : at // 6]]
        done = at // 6
        if rng.random() < 0.01:
            writer.sync()
    return disk, truth


def after_power_loss(disk: Disk, old: bytes, rng: np.random.Generator) -> tuple[bytes, int]:
    """Return what the disk holds and how much of it is safe, for power cut at some moment."""
    cut = int(rng.integers(disk.synced[0], len(disk.data) + 1))
    safe = max(synced for synced in disk.synced if synced <= cut)
    # The length is metadata: it may be ahead of the pages, behind them, or between two.
    data = bytearray(disk.data[: int(rng.integers(safe, cut + 1))])
    for page in range(safe // PAGE * PAGE, len(data), PAGE):
        start, stop = max(page, safe), min(page + PAGE, len(data))
        fate = rng.choice(["kept", "zero", "old"])
        if fate == "zero":
            data[start:stop] = bytes(stop - start)
        elif fate == "old":
            data[start:stop] = old[start:stop].ljust(stop - start, b"\0")
    return bytes(data), safe


@pytest.mark.parametrize("seed", range(5))
def test_power_loss_gives_no_wrong_value(seed: int) -> None:
    """One hundred states a seed: every synced record is there, every value is one that was sent, in its own read."""
    disk, truth = recording(seed, log=seed)
    old = bytes(recording(seed + 100, log=seed + 100)[0].data)
    whole = {record.sequence: record for record in parse_log(bytes(disk.data))}
    rng = np.random.default_rng(seed)
    for _ in range(100):
        data, safe = after_power_loss(disk, old, rng)
        contents = parse_log(data)
        for record in (read := list(contents)):
            written = whole[record.sequence]
            assert (record.mono_ns, record.kind, record.payload) == (written.mono_ns, written.kind, written.payload)
        synced = {number for number, record in whole.items() if record.offset < safe}
        assert synced <= {record.sequence for record in read}
        assert contents.header == HEADER
        (decoded,) = decode_log(contents, [SENSOR], lambda _: Frames())
        samples = decoded.samples
        host_ns = np.empty(0, np.int64) if samples.host_ns is None else samples.host_ns
        for moment in np.unique(host_ns):
            values = samples.distance[host_ns == moment].tolist()
            sent = truth[int(moment)]
            assert values == sent[len(sent) - len(values) :], "a wrong value"
