"""Power loss: pages that were never synced come back as zeros, as old blocks or not at all; no value is wrong.

No process and no plug is needed: a file in memory notes how far it was at each sync, and a seeded disk then keeps what
was synced and does what it likes with every page after that. ``SPRINGMASS_KILLS`` sets the number of states.
"""

import os
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from springmass.cli import main
from storage.run_file.reading import open_run
from storage.wire_log.appending import WireLogWriter
from storage.wire_log.records import LogHeader, RecordKind, SensorEntry
from tests.wire import Disk, append

KILLS = int(os.environ.get("SPRINGMASS_KILLS", "0"))
PAGE = 4096
STEP_NS = 10_000_000
HEADER = LogHeader(sensors=(SensorEntry(0, "maxbotix-hr", "COM3", 57600),), mono_ns=0, unix_ns=0)
"""Of a sensor without a checksum: the halves of two frames would make a value."""


class SyncedDisk(Disk):
    """A file in memory that notes how far it was at each sync."""

    def __init__(self) -> None:
        super().__init__()
        self.synced: list[int] = []

    def sync(self) -> None:
        """Note how far the file is."""
        self.synced.append(len(self.data))


@dataclass
class Sent:
    """Millimetres that the reads completed, by their times, and where in the log each value stands."""

    by_time: dict[int, list[int]] = field(default_factory=dict)
    ends: list[tuple[int, int]] = field(default_factory=list)

    def until(self, size: int) -> list[int]:
        """Return the values of the reads within so many bytes."""
        return [value for end, value in self.ends if end <= size]


def recording(seed: int, log: int) -> tuple[SyncedDisk, Sent]:
    """Return a file with its syncs, and what was sent: reads of a few frames that are cut anywhere.

    Another log of the same seed has other values in the same places, so that an old block joins without a seam.
    """
    rng = np.random.default_rng(seed)
    disk, sent = SyncedDisk(), Sent()
    writer = WireLogWriter("run.wire", HEADER, open_file=disk, log=log)
    values = np.random.default_rng(log).integers(301, 5000, 1500).tolist()
    stream = b"".join(b"R%04d\r" % value for value in values)
    at = done = read = 0
    while at < len(stream):
        read += 1
        size = int(rng.integers(1, 60))
        append(writer, RecordKind.DATA, stream[at : at + size], mono_ns=read * STEP_NS)
        at = min(at + size, len(stream))
        sent.by_time[read * STEP_NS] = values[done : at // 6]
        sent.ends += [(len(disk.data), value) for value in values[done : at // 6]]
        done = at // 6
        if rng.random() < 0.02:
            writer.sync()
    return disk, sent


def after_power_loss(disk: SyncedDisk, old: bytes, rng: np.random.Generator) -> tuple[bytes, int]:
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


def demand_true(log: Path, sent: Sent, safe: int) -> None:
    """Demand of the run file of a log that it holds what was synced, and of the rest true values at their times."""
    out = log.with_suffix(".h5")
    assert main(["-q", "recover", str(log), "-o", str(out), "--overwrite"]) == 0
    with open_run(out) as run:
        assert run.originals()[0].data == log.read_bytes()
        samples = run.samples()
    host_ns = np.empty(0, np.int64) if samples.host_ns is None else samples.host_ns
    result = np.rint(1e3 * samples.distance).astype(int).tolist()
    synced = sent.until(safe)
    assert result[: len(synced)] == synced
    for moment in np.unique(host_ns).tolist():
        values = [value for value, at in zip(result, host_ns.tolist(), strict=True) if at == moment]
        true = sent.by_time[moment]
        assert values == true[len(true) - len(values) :], "a wrong value"


@pytest.mark.parametrize(
    ("seed", "states"), [(0, 25), pytest.param(1, max(25, KILLS), marks=pytest.mark.trials)], ids=["few", "many"]
)
def test_power_loss_gives_no_wrong_value(tmp_path: Path, seed: int, states: int) -> None:
    """Every synced reading is in the run file; every other one is there as it was sent, at its time, or missing."""
    disk, sent = recording(seed, log=100)
    old = bytes(recording(seed, log=200)[0].data)
    rng = np.random.default_rng(seed)
    log = tmp_path / "run.wire"
    for _ in range(states):
        data, safe = after_power_loss(disk, old, rng)
        log.write_bytes(data)
        demand_true(log, sent, safe)
