"""Recovery: what the chain showed live is what the run file holds, and the log is inside it."""

import math
import os
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from acquisition.block import Block, Flag, concatenate
from acquisition.clock import VirtualClock
from acquisition.decoders.registry import get_family
from acquisition.events import Dropped, Event, RunEnded, StoredEvent, TimedOut
from acquisition.live.calibration import Calibration
from acquisition.live.decoding import SensorChain
from storage.errors import LogGrowing, NotALog, RunDamaged, RunExists
from storage.recorder import Recorder
from storage.recovery.recover import open_log, read_longest_part, recover
from storage.run_file.reading import RunFile, open_run
from storage.wire_log.appending import WireLogWriter
from storage.wire_log.records import LogHeader, RecordKind, SensorEntry
from storage.wire_log.scanning import read_log
from tests.unit.storage.recovery.test_parts import codes
from tests.wire import append, bits, line

FAMILY = "line-protocol"
START_NS = 7_000_000_000
HEADER = LogHeader(
    sensors=(SensorEntry(0, FAMILY, "COM3", 115200, 100.0),),
    mono_ns=START_NS,
    unix_ns=1_600_000_000_000_000_000,
    kind="simulated",
    scene={"bob": {"mass_kg": 0.2}},
    title="Run 3",
    version="0.1.0",
)


def wire(count: int, seed: int = 0) -> list[tuple[int, bytes]]:
    """Return the reads of a port at which a sensor sends lines at 100 Hz: host times in ns and bytes, cut anywhere."""
    rng = np.random.default_rng(seed)
    reads: list[tuple[int, bytes]] = []
    held = b""
    for n in range(count):
        held += line(n, 2e6 * (0.3 + 0.05 * math.sin(0.14 * n)) / 344)
        keep = int(rng.integers(0, 20))
        reads.append((START_NS + 2_000_000_000 + 10_000_000 * n, held[: len(held) - keep]))
        held = held[len(held) - keep :]
    return [*reads, (reads[-1][0] + 1, held)]


def write(path: Path, header: LogHeader = HEADER, count: int = 200) -> Path:
    """Record the wire's reads on every channel, with a mark half way."""
    with Recorder(path, header, VirtualClock(START_NS)) as recorder:
        for number, (host_ns, data) in enumerate(wire(count)):
            for sensor in header.sensors:
                recorder.reads([(sensor.channel, host_ns, data)])
            if number == count // 2:
                recorder.mark("half way", host_ns=host_ns)
    return path


def samples_of(path: Path) -> Block:
    """Return the samples of a run file."""
    with open_run(path) as run:
        return run.samples()


def test_a_recovered_run_is_what_was_seen_live(tmp_path: Path) -> None:
    """The samples equal those of the live chain bit for bit; the log, the header and the mark are in the file."""
    log = write(tmp_path / "run.wire")
    live = SensorChain(get_family(FAMILY), rate_hz=100.0)
    shown = concatenate(live.feed(host_ns, data) for host_ns, data in wire(200))
    report = recover(log, provenance={"software": "springmass"})
    assert (report.damage.intact, report.damage.ended) == (True, True)
    with open_run(tmp_path / "run.h5") as run:
        run.verify()
        assert bits(run.samples()) == bits(shown)
        assert run.originals()[0].data == log.read_bytes()
        assert (run.info, run.header.title, run.header.scene) == (live.info("COM3", "simulated"), "Run 3", HEADER.scene)
        assert (run.header.format, run.traps, run.header.malformed_rows) == ("wire", (), 0)
        reported = run.provenance
    assert (reported["software"], reported["recorded_with"], reported["reads"]) == ("springmass", "0.1.0", 201)
    assert reported["log"]["ended"]
    assert (reported["marks"][0]["text"], round(reported["marks"][0]["t_s"], 2)) == ("half way", 1.0)
    assert reported["clock_map"]["t0_mono_ns"] == pytest.approx(START_NS + 2_000_000_000, abs=1_000_000)
    began = datetime.fromisoformat(reported["start_time"]) - datetime(2020, 9, 13, 12, 26, 42, tzinfo=UTC)
    assert abs(began.total_seconds()) < 2e-3


@pytest.mark.parametrize("event", [TimedOut(), Dropped()], ids=lambda event: event.kind)
def test_no_frame_is_put_together_across_a_break(event: Event, tmp_path: Path) -> None:
    """Half a frame before lost reads and half a frame after them make no value."""
    header = LogHeader(sensors=(SensorEntry(0, "maxbotix-hr"), SensorEntry(1, "maxbotix-hr")), mono_ns=0, unix_ns=0)
    log = tmp_path / "run.wire"
    with Recorder(log, header, VirtualClock()) as recorder:
        for channel in (0, 1):
            recorder.reads([(channel, 1, b"R1000\rR1000\rR12")])
        recorder.event(0, 2, event)
        for channel in (0, 1):
            recorder.reads([(channel, 3, b"34\rR1000\rR1000\r")])
    broken, whole = (samples_of(run.path) for run in recover(log).runs)
    assert 1234 not in np.round(broken.distance * 1000).tolist()
    assert 1234 in np.round(whole.distance * 1000).tolist()
    assert np.count_nonzero(broken.flags & Flag.GAP_BEFORE) == 1


def test_the_last_calibration_in_the_log_is_applied(tmp_path: Path) -> None:
    """A calibration made after the start counts for all of the run: what is stored are echo times."""
    sensor = SensorEntry(0, FAMILY, calibration=asdict(Calibration(offset_m=1.0)))
    log = WireLogWriter(tmp_path / "run.wire", LogHeader(sensors=(sensor,), mono_ns=0, unix_ns=0))
    for host_ns, data in wire(50):
        append(log, RecordKind.DATA, data, mono_ns=host_ns)
    log.close()
    recover(log.path, tmp_path / "a.h5")
    with Recorder(tmp_path / "b.wire", LogHeader(sensors=(sensor,), mono_ns=0, unix_ns=0), VirtualClock()) as recorder:
        for host_ns, data in wire(50):
            recorder.reads([(0, host_ns, data)])
        recorder.event(0, 1, StoredEvent("calibration", asdict(Calibration(offset_m=2.0))))
    recover(tmp_path / "b.wire", tmp_path / "b.h5")
    with open_run(tmp_path / "a.h5") as first, open_run(tmp_path / "b.h5") as second:
        assert first.samples().distance[0] == pytest.approx(1.3, abs=1e-4)
        assert second.samples().distance[0] == pytest.approx(2.3, abs=1e-4)
        assert second.provenance["sensor"]["calibration"]["offset_m"] == 2.0


def test_a_run_without_samples_is_a_run(tmp_path: Path) -> None:
    """A recording stopped before the first frame gives a file that opens."""
    with Recorder(tmp_path / "run.wire", HEADER, VirtualClock()):
        pass
    report = recover(tmp_path / "run.wire")
    with open_run(report.runs[0].path) as run:
        run.verify()
        assert len(run) == 0
        assert run.provenance["start_time"] == "2020-09-13T12:26:40.000000+00:00"


def test_the_log_goes_only_when_the_run_file_verifies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Asked to remove the log, recovery does so after reading the run file back, and not before."""
    log = write(tmp_path / "run.wire", count=10)

    def damaged(_: RunFile) -> None:
        raise RunDamaged("run.h5", "the column 'time' is damaged", "restore it")

    with monkeypatch.context() as patch:
        patch.setattr(RunFile, "verify", damaged)
        with pytest.raises(RunDamaged):
            recover(log, remove_log=True)
    assert log.exists()
    assert not recover(log, overwrite=True).log_removed
    assert recover(log, overwrite=True, remove_log=True).log_removed
    assert not log.exists()


def test_a_recovery_that_was_killed_is_called_again(tmp_path: Path) -> None:
    """Run files that stand there and hold all of the log are taken as they are, and the others are made."""
    sensors = tuple(SensorEntry(channel, FAMILY) for channel in range(6))
    log = write(tmp_path / "run.wire", LogHeader(sensors=sensors, mono_ns=0, unix_ns=0), count=40)
    whole = recover(log)
    bytes_of = {run.path: run.path.read_bytes() for run in whole.runs}
    for channel in (1, 4):
        (tmp_path / f"run.{channel}.h5").unlink()
    again = recover(log)
    assert [run.existed for run in again.runs] == [True, False, True, True, False, True]
    assert [(run.path, run.samples) for run in again.runs] == [(run.path, 40) for run in whole.runs]
    assert {run.path: run.path.read_bytes() for run in again.runs} == bytes_of
    assert again.damage == whole.damage
    with pytest.raises(RunExists):
        recover(log, speed_of_sound_m_per_s=340.0)


def test_a_log_that_grew_meanwhile_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bytes that came after the reading are in no run file yet."""
    log = write(tmp_path / "run.wire", count=10)
    real = RunFile.verify

    def slow(run: RunFile) -> None:
        real(run)
        with log.open("ab") as file:
            file.write(b"more")

    monkeypatch.setattr(RunFile, "verify", slow)
    assert not recover(log, remove_log=True).log_removed
    assert log.read_bytes().endswith(b"more")


def test_a_log_without_its_header_is_refused(tmp_path: Path) -> None:
    """Nothing else says which sensors sent the bytes."""
    log = write(tmp_path / "run.wire", count=50)
    data = log.read_bytes()
    first, *_ = read_log(log)
    log.write_bytes(bytes(first.offset + 28 + len(first.payload)) + data[28 + len(first.payload) :])
    with pytest.raises(NotALog, match=r"both copies of the log's header are lost \(.*\); "):
        recover(log)


@pytest.mark.skipif(os.name == "nt", reason="this system has no such locks")
def test_a_log_that_is_still_written_is_not_recovered(tmp_path: Path) -> None:
    """While a recorder has the log, no run file is made; afterwards it is."""
    log = tmp_path / "run.wire"
    with Recorder(log, HEADER, VirtualClock()) as recorder:
        for host_ns, data in wire(100):
            recorder.reads([(0, host_ns, data)])
        recorder.drain()
        with pytest.raises(LogGrowing):
            recover(log)
        with pytest.raises(LogGrowing):
            recover(recorder.contents())
        assert not log.with_suffix(".h5").exists()
        recording, *_ = read_longest_part(*open_log(log), 0)
        assert len(recording.samples) > 0
    assert recover(log).runs[0].samples == 100


@pytest.mark.skipif(os.name == "nt", reason="this system lets nobody rename or delete an open file")
@pytest.mark.parametrize("by", ["deleted", "renamed", "replaced"])
def test_a_log_without_its_name_is_recovered_from_its_recorder(tmp_path: Path, by: str) -> None:
    """All that was recorded is in the run file; nothing is removed by a name that leads to another file, or nowhere."""
    (tmp_path / "bench").mkdir()
    log = tmp_path / "bench" / "run.wire"
    with Recorder(log, HEADER, VirtualClock()) as recorder:
        for host_ns, data in wire(50):
            recorder.reads([(0, host_ns, data)])
        recorder.drain()
        whole = log.read_bytes()
        if by == "renamed":
            log.rename(tmp_path / "other.wire")
        else:
            log.unlink()
        if by == "replaced":
            log.write_bytes(b"mine")
        for host_ns, data in wire(100)[50:]:
            recorder.reads([(0, host_ns, data)])
    report = recover(recorder.contents(), tmp_path / "run.h5", remove_log=True)
    assert (report.runs[0].samples, report.log_removed, report.damage.intact) == (100, False, True)
    with open_run(tmp_path / "run.h5") as run:
        (original,) = run.originals()
    assert (original.name, original.data[: len(whole)]) == ("run.wire", whole)
    remaining = {path.name: path.read_bytes() for path in tmp_path.rglob("*.wire")}
    assert remaining == {"renamed": {"other.wire": original.data}, "replaced": {"run.wire": b"mine"}}.get(by, {})


def test_what_a_sensor_did_not_give_is_named(tmp_path: Path) -> None:
    """A stretch without echoes and a sensor that is silent until the end are in the run file."""
    with Recorder(tmp_path / "run.wire", HEADER, VirtualClock(START_NS)) as recorder:
        for n in range(1000):
            recorder.reads([(0, START_NS + 10_000_000 * n, line(n, math.nan if 300 <= n < 500 else 1500.0))])
        recorder.event(0, START_NS + 20_000_000_000, RunEnded(by="seconds"))
    (made,) = recover(tmp_path / "run.wire").runs
    with open_run(made.path) as run:
        assert codes(run) == {"no_target", "sensor_lost"}
        assert np.flatnonzero(run.samples().flags & Flag.MISSING).tolist() == list(range(300, 500))
