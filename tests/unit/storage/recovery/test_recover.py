"""Recovery: what the chain showed live is what the run file holds, and the log is inside it."""

from __future__ import annotations

import math
import os
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.block import Block, Flag, concatenate
from acquisition.clock import VirtualClock
from acquisition.decoders.registry import get_family
from acquisition.live import timebase
from acquisition.live.calibration import Calibration
from acquisition.live.decoding import SensorChain
from storage.atomic import whole_file
from storage.errors import OutOfMemory, RunDamaged, RunExists
from storage.recorder import Recorder
from storage.recovery import recover as module
from storage.recovery.recover import LogGrowing, recover, verify_against_log
from storage.run_file.arrays import Columns, Originals
from storage.run_file.reading import Run, open_run
from storage.wire_log import notes
from storage.wire_log.appending import WireLogWriter
from storage.wire_log.records import Kind, LogHeader, SensorEntry
from storage.wire_log.scanning import NotALog, read_log
from storage.wire_log.wire_samples import decode_log

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
    encoder = get_family(FAMILY).encoder()
    rng = np.random.default_rng(seed)
    reads: list[tuple[int, bytes]] = []
    held = b""
    for n in range(count):
        distance = 0.3 + 0.05 * math.sin(0.14 * n)
        held += encoder.encode(
            sequence=n,
            device_us=10_000 * n,
            echo_us=2e6 * distance / 344,
            distance_m=distance,
            temperature_c=math.nan,
        )
        keep = int(rng.integers(0, 20))
        reads.append((START_NS + 2_000_000_000 + 10_000_000 * n, held[: len(held) - keep]))
        held = held[len(held) - keep :]
    return [*reads, (reads[-1][0] + 1, held)]


def write(path: Path, header: LogHeader = HEADER, count: int = 200) -> Path:
    """Record the wire's reads on every channel, with a mark half way."""
    with Recorder(path, header, VirtualClock(START_NS)) as recorder:
        for number, (host_ns, data) in enumerate(wire(count)):
            for sensor in header.sensors:
                recorder.put(sensor.channel, host_ns, data)
            if number == count // 2:
                recorder.mark("half way", host_ns=host_ns)
    return path


def columns(block: Block) -> list[Any]:
    """Return a block's values, comparable."""
    assert block.host_ns is not None
    return [block.t.tolist(), [repr(x) for x in block.distance.tolist()], block.flags.tolist(), block.host_ns.tolist()]


def traps(run: Run) -> set[str]:
    """Return the codes of a run's traps."""
    return {trap.code for trap in run.traps}


def test_a_recovered_run_is_what_was_seen_live(tmp_path: Path) -> None:
    """The samples equal those of the live chain bit for bit; the log, the header and the mark are in the file."""
    log = write(tmp_path / "run.wire")
    live = SensorChain(get_family(FAMILY), rate_hz=100.0)
    shown = concatenate(live.feed(host_ns, data) for host_ns, data in wire(200))
    report = recover(log, provenance={"software": "springmass"})
    first, clock, last = report.describe()
    assert first == f"{tmp_path / 'run.h5'}: 200 samples from {log}"
    assert clock.startswith(f"{tmp_path / 'run.h5'}: sensor clock ")
    assert " ppm against this computer's" in clock
    assert last == f"{log}: {report.damage.records} records"
    with open_run(tmp_path / "run.h5") as run:
        run.verify()
        assert columns(run.samples()) == columns(shown)
        assert run.originals()[0].data == log.read_bytes()
        assert (run.info, run.title, run.scene) == (live.info("COM3", "simulated"), "Run 3", HEADER.scene)
        assert (run.format, run.traps, run.malformed_rows) == ("wire", (), 0)
        reported = run.provenance
    assert (reported["software"], reported["recorded_with"], reported["reads"]) == ("springmass", "0.1.0", 201)
    assert reported["log"]["ended"]
    assert (reported["marks"][0]["text"], round(reported["marks"][0]["t_s"], 2)) == ("half way", 1.0)
    assert reported["clock_map"]["t0_mono_ns"] == pytest.approx(START_NS + 2_000_000_000, abs=1_000_000)
    began = datetime.fromisoformat(reported["start_time"]) - datetime(2020, 9, 13, 12, 26, 42, tzinfo=UTC)
    assert abs(began.total_seconds()) < 2e-3


def test_several_sensors_make_several_files(tmp_path: Path) -> None:
    """Each channel has a separate run file, each with the whole log inside."""
    sensors = (SensorEntry(0, FAMILY, "A"), SensorEntry(5, FAMILY, "B"))
    log = write(tmp_path / "run.wire", LogHeader(sensors=sensors, mono_ns=0, unix_ns=0))
    report = recover(log, tmp_path / "out.h5")
    assert [run.path.name for run in report.runs] == ["out.0.h5", "out.5.h5"]
    for run, name in zip(report.runs, "AB", strict=True):
        with open_run(run.path) as opened:
            assert (len(opened), opened.info.name) == (200, name)
            assert opened.originals()[0].data == log.read_bytes()


def test_a_torn_log_gives_what_it_holds_and_says_so(tmp_path: Path) -> None:
    """A log cut in a record and damaged in another gives the rest; the damage is in the provenance and the traps."""
    log = write(tmp_path / "run.wire")
    data = bytearray(log.read_bytes()[:-40])
    victim = [record for record in read_log(log) if record.kind is Kind.DATA][100]
    data[victim.offset + 30] ^= 4
    log.write_bytes(data)
    report = recover(log)
    assert (report.damage.lost, report.damage.intact, report.damage.ended) == (1, False, False)
    with open_run(report.runs[0].path) as run:
        assert 195 <= len(run) <= 199
        assert traps(run) == {"damaged_log", "cut_short"}
        assert run.provenance["log"]["lost"] == 1
        samples = run.samples()
        after = int(np.flatnonzero(samples.flags & Flag.GAP_BEFORE)[0])
        assert samples.t[after] - samples.t[after - 1] > 0.015
        expected = 0.3 + 0.05 * np.sin(14 * (samples.t - samples.distance / 344.0))  # as at the ping
        assert np.max(np.abs(samples.distance - expected)) < 1e-4
        assert run.originals()[0].data == bytes(data)


@pytest.mark.parametrize("event", ["lost", "reopened", "timeout", "overflow"])
def test_no_frame_is_put_together_across_a_break(event: str, tmp_path: Path) -> None:
    """Half a frame before the port went away and half a frame after it make no value."""
    header = LogHeader(sensors=(SensorEntry(0, "maxbotix-hr"), SensorEntry(1, "maxbotix-hr")), mono_ns=0, unix_ns=0)
    log = tmp_path / "run.wire"
    with Recorder(log, header, VirtualClock()) as recorder:
        for channel in (0, 1):
            recorder.put(channel, 1, b"R1000\rR1000\rR12")
        recorder.event(0, 2, event, {})
        for channel in (0, 1):
            recorder.put(channel, 3, b"34\rR1000\rR1000\r")
    broken, whole = decode_log(read_log(log), header.sensors)
    assert 1234 not in np.round(broken.distance * 1000).tolist()
    assert 1234 in np.round(whole.distance * 1000).tolist()
    assert np.count_nonzero(broken.flags & Flag.GAP_BEFORE) == 1


def test_the_last_calibration_in_the_log_is_applied(tmp_path: Path) -> None:
    """A calibration made after the start counts for all of the run: what is stored are echo times."""
    sensor = SensorEntry(0, FAMILY, calibration=Calibration(offset_m=1.0).to_mapping())
    log = WireLogWriter(tmp_path / "run.wire", LogHeader(sensors=(sensor,), mono_ns=0, unix_ns=0))
    for host_ns, data in wire(50):
        log.append(Kind.DATA, data, mono_ns=host_ns)
    log.close()
    recover(log.path, tmp_path / "a.h5")
    with Recorder(tmp_path / "b.wire", LogHeader(sensors=(sensor,), mono_ns=0, unix_ns=0), VirtualClock()) as recorder:
        for host_ns, data in wire(50):
            recorder.put(0, host_ns, data)
        recorder.event(0, 1, "calibration", Calibration(offset_m=2.0).to_mapping())
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


def test_nothing_is_written_over_unasked(tmp_path: Path) -> None:
    """A run file stands, unless its overwriting is asked for."""
    log = write(tmp_path / "run.wire", count=10)
    (tmp_path / "run.h5").write_bytes(b"old")
    with pytest.raises(RunExists, match=r"run\.h5: already exists"):
        recover(log)
    assert (tmp_path / "run.h5").read_bytes() == b"old"
    assert recover(log, overwrite=True).runs[0].samples == 10


def test_the_log_goes_only_when_the_run_file_verifies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Asked to remove the log, recovery does so after reading the run file back, and not before."""
    log = write(tmp_path / "run.wire", count=10)

    def damaged(_: Run) -> None:
        raise RunDamaged("run.h5", "the column 'time' is damaged", "restore it")

    with monkeypatch.context() as patch:
        patch.setattr(Run, "verify", damaged)
        with pytest.raises(RunDamaged):
            recover(log, remove_log=True)
    assert log.exists()
    assert not recover(log, overwrite=True).log_removed
    assert recover(log, overwrite=True, remove_log=True).log_removed
    assert not log.exists()


def test_a_log_is_what_a_run_file_is_held_against(tmp_path: Path) -> None:
    """A run file of this log passes; one of another log, or of this one before it went on, is refused by name."""
    log, second = write(tmp_path / "run.wire", count=10), write(tmp_path / "other.wire", count=20)
    recover(log)
    recover(second)
    verify_against_log(tmp_path / "run.h5", log)
    with pytest.raises(RunDamaged, match=r"run\.h5: the log inside differs from .*other\.wire; keep the log"):
        verify_against_log(tmp_path / "run.h5", second)
    with log.open("ab") as file:
        file.write(b"more")
    with pytest.raises(RunDamaged, match=r"the log inside differs from .*run\.wire"):
        verify_against_log(tmp_path / "run.h5", log)


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
    assert (again.marks, again.damage) == (whole.marks, whole.damage) == (1, whole.damage)
    assert recover(log).describe().__next__().endswith("; it existed already and holds the whole log")
    with pytest.raises(RunExists):
        recover(log, speed_of_sound_m_per_s=340.0)


def test_what_a_killed_build_left_is_removed_and_named(tmp_path: Path) -> None:
    """A temporary file that nobody holds goes; one that a living writer is at work on stays."""
    log = write(tmp_path / "run.wire", count=10)
    remaining = tmp_path / ".run.h5.0123abcd.part"
    with whole_file(tmp_path / "other.h5") as living:
        remaining.write_bytes(b"half")
        lines = list(recover(log).describe())
        assert living.exists()
    assert not remaining.exists()
    assert lines[0].startswith(f"{remaining}: removed")


def test_notes_beyond_the_bound_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A flood of events fills no memory: the first are shown, the rest are counted, the last calibration counts."""
    monkeypatch.setattr(notes, "MAX_NOTES", 5)
    with Recorder(tmp_path / "run.wire", HEADER, VirtualClock()) as recorder:
        for host_ns, data in wire(20):
            recorder.put(0, host_ns, data)
            recorder.event(0, host_ns, "timeout", {"after_s": 1.0})
        recorder.event(0, 1, "calibration", Calibration(offset_m=2.0).to_mapping())
    report = recover(tmp_path / "run.wire")
    assert report.events == 22
    with open_run(report.runs[0].path) as run:
        assert (len(run.provenance["events"]), run.provenance["notes_left_out"]) == (5, 17)
        assert run.samples().distance.min() > 2.2


def test_gaps_beyond_the_bound_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A sensor half as fast as its rate says has a gap at each reading: the first are shown, the rest are counted."""
    monkeypatch.setattr(timebase, "KEPT_GAPS", 5)
    sensor = SensorEntry(0, FAMILY, rate_hz=200.0)
    log = write(tmp_path / "run.wire", LogHeader(sensors=(sensor,), mono_ns=0, unix_ns=0), count=40)
    report = recover(log)
    decoding = report.runs[0].decoding
    assert len(decoding["gaps"]) == 5
    assert decoding["gaps_left_out"] == {"count": 34, "lost": 34, "longest_s": pytest.approx(0.01)}
    assert f"{tmp_path / 'run.h5'}: 39 gaps with 39 lost readings, the longest 0.01 s" in report.describe()


def test_too_little_memory_is_no_damaged_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What HDF5 or numpy say of memory is said of the machine and not of the file; no run file is left."""
    log = write(tmp_path / "run.wire", count=10)

    def starved(*_: Any) -> None:
        raise MemoryError

    monkeypatch.setattr(Columns, "finish", starved)
    with pytest.raises(MemoryError):
        recover(log)
    monkeypatch.setattr(Originals, "take", starved)
    with pytest.raises(OutOfMemory, match=r"run\.h5: out of memory"):
        recover(log)
    assert [path.name for path in tmp_path.iterdir()] == ["run.wire"]


def test_a_log_that_grew_meanwhile_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bytes that came after the reading are in no run file yet."""
    log = write(tmp_path / "run.wire", count=10)
    real = module.chains_of

    def slow(*arguments: Any) -> Any:
        with log.open("ab") as file:
            file.write(b"more")
        return real(*arguments)

    monkeypatch.setattr(module, "chains_of", slow)
    assert not recover(log, remove_log=True).log_removed
    assert log.read_bytes().endswith(b"more")


def test_a_log_without_its_header_needs_one(tmp_path: Path) -> None:
    """The error says that the sensors must be named; named, all that the log holds is there."""
    log = write(tmp_path / "run.wire", count=50)
    data = log.read_bytes()
    first, *_ = read_log(log)
    log.write_bytes(bytes(first.offset + 28 + len(first.payload)) + data[28 + len(first.payload) :])
    with pytest.raises(NotALog, match=r"all copies of the log's header are lost \(.*\); "):
        recover(log)
    assert recover(log, header=HEADER).runs[0].samples == 50


@pytest.mark.parametrize("data", [b"", b"Time (s)\t0.1\n", bytes(10_000)])
def test_what_is_no_log_is_refused_in_one_line(data: bytes, tmp_path: Path) -> None:
    """An empty file, a text and zeros are no logs, nor is a file that is not there."""
    path = tmp_path / "any.wire"
    with pytest.raises(NotALog, match="cannot be read"):
        recover(path)
    path.write_bytes(data)
    with pytest.raises(NotALog, match=rf"any\.wire: expected a wire log, got {len(data)} bytes without a record"):
        recover(path)
    assert not (tmp_path / "any.h5").exists()


def test_bytes_of_an_unnamed_channel_stay_in_the_log(tmp_path: Path) -> None:
    """A channel that the header does not name is passed over, not mixed into another's."""
    header = LogHeader(sensors=(SensorEntry(3, FAMILY),), mono_ns=0, unix_ns=0)
    with Recorder(tmp_path / "run.wire", header, VirtualClock()) as recorder:
        for host_ns, data in wire(20):
            recorder.put(4, host_ns, data[::-1])
            recorder.put(3, host_ns, data)
    (samples,) = decode_log(read_log(tmp_path / "run.wire"), header.sensors)
    assert len(samples) == 20


@pytest.mark.skipif(os.name == "nt", reason="this system has no such locks")
def test_a_log_that_is_still_written_is_not_recovered(tmp_path: Path) -> None:
    """While a recorder has the log, no run file is made; afterwards it is."""
    log = tmp_path / "run.wire"
    with Recorder(log, HEADER, VirtualClock()) as recorder:
        for host_ns, data in wire(100):
            recorder.put(0, host_ns, data)
        recorder.drain()
        with pytest.raises(LogGrowing):
            recover(log)
        with pytest.raises(LogGrowing):
            recover(recorder.contents())
        assert not log.with_suffix(".h5").exists()
        assert recover(log, tmp_path / "so-far.h5", growing=True).runs[0].samples > 0
    assert recover(log).runs[0].samples == 100


@pytest.mark.skipif(os.name == "nt", reason="this system lets nobody rename or delete an open file")
@pytest.mark.parametrize("by", ["deleted", "renamed", "replaced", "its folder deleted"])
def test_a_log_without_its_name_is_recovered_from_its_recorder(tmp_path: Path, by: str) -> None:
    """All that was recorded is in the run file; nothing is removed by a name that leads to another file, or nowhere."""
    (tmp_path / "bench").mkdir()
    log = tmp_path / "bench" / "run.wire"
    with Recorder(log, HEADER, VirtualClock()) as recorder:
        for host_ns, data in wire(50):
            recorder.put(0, host_ns, data)
        recorder.drain()
        whole = log.read_bytes()
        if by == "renamed":
            log.rename(tmp_path / "other.wire")
        else:
            log.unlink()
        if by == "replaced":
            log.write_bytes(b"mine")
        if by == "its folder deleted":
            log.parent.rmdir()
        for host_ns, data in wire(100)[50:]:
            recorder.put(0, host_ns, data)
    assert recorder.status.astray
    report = recover(recorder.contents(), tmp_path / "run.h5", remove_log=True)
    assert (report.runs[0].samples, report.log_removed, report.damage.intact) == (100, False, True)
    with open_run(tmp_path / "run.h5") as run:
        (original,) = run.originals()
    assert (original.name, original.data[: len(whole)]) == ("run.wire", whole)
    remaining = {path.name: path.read_bytes() for path in tmp_path.rglob("*.wire")}
    assert remaining == {"renamed": {"other.wire": original.data}, "replaced": {"run.wire": b"mine"}}.get(by, {})


def replaced_log(path: Path, counts: tuple[int, ...]) -> None:
    """Write a log of one port on which other sensors came back, with so many readings of each."""
    with Recorder(path, HEADER, VirtualClock()) as recorder:
        now_ns = START_NS
        for channel, count in enumerate(counts):
            if channel:
                facts = {"port": "COM3", "gap_s": 0.5, "sensor": "another"}
                recorder.event(channel - 1, now_ns, "lost", {"why": "cable"})
                recorder.event(channel - 1, now_ns, "replaced", {**facts, "channel": channel})
                recorder.event(channel, now_ns, "continues", {**facts, "of": channel - 1})
            for host_ns, data in wire(count, seed=channel):
                recorder.put(channel, now_ns + host_ns - START_NS, data)
            now_ns += 10_000_000 * count + 500_000_000
        recorder.event(0, now_ns, "ended", {"by": "seconds"})


def test_each_sensor_that_came_back_as_another_has_its_own_run(tmp_path: Path) -> None:
    """Named by its channel; the longest is the one to analyse, and each says where the rest is."""
    log = tmp_path / "run.wire"
    replaced_log(log, (100, 300, 50))
    report = recover(log, remove_log=True)
    assert [run.path.name for run in report.runs] == ["run.h5", "run.1.h5", "run.2.h5"]
    assert [run.samples for run in report.runs] == [100, 300, 50]
    assert report.main.path == tmp_path / "run.1.h5"
    assert any("the longest part is" in line for line in report.describe())
    assert not log.exists()
    for run in report.runs:
        with open_run(run.path) as made:
            assert made.provenance["sensor"]["channel"] == run.sensor.channel
            assert made.provenance["sensor"]["port"] == "COM3"
            replaced = [trap for trap in made.traps if trap.code == "sensor_replaced"]
            assert len(replaced) == (2 if run.sensor.channel == 1 else 1)
            assert made.samples().t[0] < 0.01


def test_run_files_of_parts_that_stand_there_are_taken_as_they_are(tmp_path: Path) -> None:
    """A build that was killed between two of them is finished; a log that was cut short gives what it holds."""
    log = tmp_path / "run.wire"
    replaced_log(log, (100, 300))
    recover(log)
    (tmp_path / "run.1.h5").unlink()
    assert [(run.existed, run.samples) for run in recover(log).runs] == [(True, 100), (False, 300)]
    assert [run.existed for run in recover(log).runs] == [True, True]
    torn = tmp_path / "torn.wire"
    torn.write_bytes(log.read_bytes()[: log.stat().st_size * 2 // 3])
    first, second = recover(torn).runs
    assert first.samples == 100
    assert 50 < second.samples < 300


def test_a_log_of_an_earlier_version_is_timed_rightly_where_a_counter_leapt(tmp_path: Path) -> None:
    """Its event does not say which sensor came back: one run, the gap by the host's clock, and a word on it."""
    log = tmp_path / "run.wire"
    encoder = get_family(FAMILY).encoder()
    with Recorder(log, HEADER, VirtualClock()) as recorder:
        for n in range(600):
            away_s, leap_us = (3.0, 2_990_000_000) if n >= 300 else (0.0, 0)
            host_ns = START_NS + 10_000_000 * n + int(away_s * 1e9)
            if n == 300:
                recorder.event(0, host_ns - 2, "lost", {"why": "cable"})
                recorder.event(0, host_ns - 1, "reopened", {"port": "COM3", "gap_s": 3.0})
            line = encoder.encode(
                sequence=n + leap_us // 10_000,
                device_us=10_000 * n + leap_us,
                echo_us=1500.0,
                distance_m=0.258,
                temperature_c=math.nan,
            )
            recorder.put(0, host_ns, line)
    (run,) = recover(log).runs
    with open_run(run.path) as made:
        t = made.samples().t
        assert "counter_changed" in {trap.code for trap in made.traps}
    np.testing.assert_allclose(t - t[0], 0.01 * np.arange(600) + 3.0 * (np.arange(600) >= 300), atol=1e-3)
    assert [gap["lost"] for gap in run.decoding["gaps"]] == [0]


def replaced(path: Path) -> Path:
    """Write a log in which another sensor comes back on the port and goes on in channel 1."""
    recorder = Recorder(path, HEADER, VirtualClock())
    recorder.reads([(0, stamp, data) for stamp, data in wire(200)])
    last = wire(200)[-1][0]
    recorder.event(0, last + 10**6, "lost", {"port": "x", "why": "unplugged"})
    recorder.event(0, last + 10**9, "replaced", {"port": "x", "gap_s": 1.0, "channel": 1})
    recorder.event(1, last + 10**9, "continues", {"port": "x", "gap_s": 1.0, "of": 0})
    recorder.reads([(1, last + 10**9 + stamp, data) for stamp, data in wire(400, 1)])
    recorder.close()
    return path


def test_a_file_in_the_way_of_a_further_part_leaves_the_first_its_run_file(tmp_path: Path) -> None:
    """The run file of the port is built, and the one line names the file that stands there."""
    log = replaced(tmp_path / "run.wire")
    (tmp_path / "run.1.h5").write_bytes(b"somebody else's")
    with pytest.raises(RunExists, match=r"run\.1\.h5"):
        recover(log)
    assert (tmp_path / "run.1.h5").read_bytes() == b"somebody else's"
    with open_run(tmp_path / "run.h5") as run:
        assert len(run.samples()) > 100


def test_one_damaged_record_hides_no_further_part(tmp_path: Path) -> None:
    """Both events state that the recording goes on in another channel: either is enough."""
    log = replaced(tmp_path / "run.wire")
    data = bytearray(log.read_bytes())
    data[data.index(b'"continues"') + 2] ^= 1
    log.write_bytes(data)
    report = recover(log)
    assert [run.path.name for run in report.runs] == ["run.h5", "run.1.h5"]
    assert report.main.path.name == "run.1.h5"
