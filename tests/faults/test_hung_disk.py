"""A disk that hangs: nothing is lost until the queue is full, and what finds it full is counted to the byte.

The sensors are written here and share no code with the decoders. The seconds of a hang are simulated: what would be
read in them is put while a write stands still. ``SPRINGMASS_TRIALS`` asks for all 50.
"""

import json
import os
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from acquisition.clock import VirtualClock
from springmass.cli import main
from storage.recorder import QUEUE_BYTES, Recorder
from storage.run_file.reading import open_run
from storage.wire_log.records import RECORD_HEAD_BYTES, LogHeader, Record, RecordKind, SensorEntry
from tests.faults.conftest import frame_of
from tests.sampling import sampled
from tests.wire import WAIT_S, Disk, json_of, parse_log

TRIALS = 50 if os.environ.get("SPRINGMASS_TRIALS") else 12
SECOND_NS = 1_000_000_000


@dataclass(frozen=True)
class Bench:
    """Sensors by channel: reads a second of each, and bytes of a read."""

    reads_hz: list[float]
    read_bytes: list[int]

    def wire(self, from_s: float, to_s: float) -> Iterator[tuple[int, int, bytes]]:
        """Yield what is read in that time, in order: channel, stamp, bytes that say which read they are."""
        due = [
            (number / rate, channel, number)
            for channel, rate in enumerate(self.reads_hz)
            for number in range(int(np.ceil(from_s * rate)), int(np.ceil(to_s * rate)))
        ]
        for at, channel, number in sorted(due):
            yield channel, round(at * 1e9), b"%d:%d;" % (channel, number) + b"." * self.read_bytes[channel]


def bench(rng: np.random.Generator) -> Bench:
    """Return one to sixteen sensors: rangefinders at 10 to 100 Hz, or the flood of a link that runs full."""
    n = int(rng.integers(1, 17))
    flood = rng.random() < 0.4
    reads_hz = rng.choice([10.0, 50.0, 100.0], n)
    sizes = rng.integers(1500, 4000, n) if flood else rng.integers(4, 100, n)
    return Bench(reads_hz.tolist(), sizes.tolist())


@pytest.mark.parametrize("seed", sampled(range(TRIALS)))
def test_a_hanging_disk_loses_what_does_not_fit_and_nothing_else(seed: int, tmp_path: Path) -> None:
    """Of 5 to 60 s: every read is in the log, or in the count of the one overflow event of its channel."""
    rng = np.random.default_rng([seed, 14])
    sensors, hang_s = bench(rng), float(rng.uniform(5.0, 60.0))
    header = LogHeader(
        sensors=tuple(SensorEntry(channel, "ffhls") for channel in range(len(sensors.reads_hz))), mono_ns=0, unix_ns=0
    )
    disk = Disk()

    def hung(stamp_ns: int) -> bool:
        return SECOND_NS <= stamp_ns < (1.0 + hang_s) * SECOND_NS

    put: dict[int, list[tuple[int, bytes]]] = defaultdict(list)

    def send(recorder: Recorder, from_s: float, to_s: float) -> None:
        for channel, stamp_ns, data in sensors.wire(from_s, to_s):
            put[channel].append((stamp_ns, data))
            recorder.reads([(channel, stamp_ns, data)])

    with Recorder(tmp_path / "run.wire", header, VirtualClock(), open_file=disk) as recorder:
        send(recorder, 0.0, 1.0)
        recorder.drain()
        disk.writes_pass.clear()
        send(recorder, 1.0, 1.1)
        assert disk.held.wait(WAIT_S)
        send(recorder, 1.1, 1.0 + hang_s)
        status = recorder.status
        disk.writes_pass.set()
        recorder.drain()
        send(recorder, 1.0 + hang_s, 2.0 + hang_s)
    # What was put while the disk hung, but for the read that hung with it and those that went along.
    sizes = [RECORD_HEAD_BYTES + len(data) for each in put.values() for stamp_ns, data in each if hung(stamp_ns)]
    if status.dropped_records:
        assert QUEUE_BYTES - max(sizes) < status.queued_bytes <= QUEUE_BYTES
        assert sum(sizes) > status.queued_bytes
    else:
        assert status.queued_bytes <= min(sum(sizes), QUEUE_BYTES)
    records = list(parse_log(bytes(disk.data)))
    dropped = sum(demand_complete(put[channel], records, channel) for channel in put)
    assert dropped == status.dropped_records == recorder.status.dropped_records
    assert json_of(records[-1])["dropped_records"] == dropped


def demand_complete(put: list[tuple[int, bytes]], records: list[Record], channel: int) -> int:
    """Demand every read of a channel, but those that its overflow event counts in its place; return their number."""
    of_channel = [record for record in records if record.channel == channel]
    events = [
        record for record in of_channel if record.kind is RecordKind.EVENT and json_of(record)["kind"] == "overflow"
    ]
    recorded = [(record.mono_ns, record.payload) for record in of_channel if record.kind is RecordKind.DATA]
    if not events:
        assert recorded == put
        return 0
    (event,) = events
    facts = json_of(event)["facts"]
    first = next(i for i, (stamp_ns, _) in enumerate(put) if stamp_ns >= facts["first_ns"])
    lost = put[first : first + facts["records"]]
    assert (lost[0][0], lost[-1][0]) == (facts["first_ns"], event.mono_ns)
    assert sum(len(data) for _, data in lost) == facts["bytes"]
    assert recorded == put[:first] + put[first + len(lost) :]
    before = [record for record in of_channel[: of_channel.index(event)] if record.kind is RecordKind.DATA]
    assert len(before) == first
    return len(lost)


def swinging(number: int) -> bytes:
    """One frame, ten a second, over a bob of 0.9 s."""
    return frame_of(round(400.0 + 50.0 * np.cos(2.0 * np.pi * number / 9.0)))


def test_what_did_not_fit_is_a_gap_with_its_time_and_length(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Ten seconds beyond a small queue: the run has the event, the gap where they are missing, and says so."""
    disk = Disk()
    header = LogHeader(sensors=(SensorEntry(0, "ffhls"),), mono_ns=0, unix_ns=0)
    room = 50 * (RECORD_HEAD_BYTES + 4)
    with Recorder(tmp_path / "run.wire", header, VirtualClock(), queue_bytes=room, open_file=disk) as recorder:
        for number in range(400):
            if number == 100:
                recorder.drain()
                disk.writes_pass.clear()
            recorder.reads([(0, SECOND_NS * number // 10, swinging(number))])
            if number == 100:
                assert disk.held.wait(WAIT_S)
            if number == 249:
                disk.writes_pass.set()
            if disk.writes_pass.is_set():
                recorder.drain()
    assert recorder.status.dropped_records == 99
    (tmp_path / "run.wire").write_bytes(disk.data)
    assert main(["recover", str(tmp_path / "run.wire")]) == 0
    with open_run(tmp_path / "run.h5") as run:
        (event,) = run.provenance["events"]
        (gap,) = run.provenance["decoding"]["gaps"]
    assert event["kind"] == "overflow"
    assert (event["facts"]["records"], event["facts"]["first_ns"]) == (99, 15_100_000_000)
    assert event["t_s"] == pytest.approx(24.9)
    assert gap == {"index": 151, "length_s": pytest.approx(10.0), "lost": 99}
    capsys.readouterr()
    assert main(["analyse", str(tmp_path / "run.h5"), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["estimates"]["period"]["value"] == pytest.approx(0.9, rel=1e-3)
