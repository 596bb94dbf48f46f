"""Power loss: pages that were never synced come back as zeros, as old blocks or not at all; no value is wrong.

No process and no plug is needed: a file in memory notes how far it was at each sync, and a seeded disk then keeps what
was synced and does what it likes with every page after that.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from acquisition.decoders.registry import get_family
from acquisition.live.decoding import SensorChain
from acquisition.readings import Reading, Readings
from storage.wire_log.appending import WireLogWriter
from storage.wire_log.records import Kind, LogHeader, SensorEntry
from storage.wire_log.scanning import parse_log
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
    """Decodes a sensor that sends ``R1234\\r``: no checksum, so that halves of two frames would make a value."""

    def __init__(self) -> None:
        self.faults: dict[str, int] = {}
        self._held = b""

    @property
    def pending(self) -> int:
        """Bytes held."""
        return len(self._held)

    def feed(self, host_ns: int, data: bytes) -> Readings:
        """Make readings of the frames that a read completes."""
        *lines, self._held = (self._held + data).split(b"\r")
        values = [int(line[1:]) for line in lines if len(line) == 5 and line[:1] == b"R"]
        return Readings(Reading(host_ns, distance_m=value) for value in values)

    def flush(self) -> None:
        """Forget half a frame; what is left of it on the other side of a break has no R."""
        self._held = b""


def chains_of(sensors: Sequence[SensorEntry]) -> list[SensorChain]:
    """Return a chain of such a sensor for each."""
    family = dataclasses.replace(get_family("maxbotix-hr"), decoder=Frames)
    return [SensorChain(family) for _ in sensors]


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
        (samples,) = decode_log(contents, [SENSOR], chains_of)
        host_ns = np.empty(0, np.int64) if samples.host_ns is None else samples.host_ns
        for moment in np.unique(host_ns):
            values = samples.distance[host_ns == moment].tolist()
            sent = truth[int(moment)]
            assert values == sent[len(sent) - len(values) :], "a wrong value"
