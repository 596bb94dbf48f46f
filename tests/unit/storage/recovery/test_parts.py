"""A sensor that comes back begins a new part: another channel of the log, another run file."""

import math
from pathlib import Path

import numpy as np
import pytest

from acquisition.block import Flag
from acquisition.clock import VirtualClock
from acquisition.events import Continued, Event, Lost, Reopened, Replaced, RunEnded
from springmass.cli import main
from storage.recorder import Recorder
from storage.recovery.recover import recover
from storage.run_file.reading import RunFile, open_run
from storage.wire_log.records import LogHeader, RecordKind, SensorEntry
from storage.wire_log.scanning import read_log
from tests.wire import line

FAMILY = "line-protocol"
SECOND_NS = 1_000_000_000


def send(recorder: Recorder, channel: int, start_s: float, seconds: float, first: int = 0) -> None:
    """Record a sensor that sends at 100 Hz; the clock of the device shows the time since reading 0."""
    for n in range(int(100 * seconds)):
        echo_us = 2e6 * (0.25 + 0.05 * math.cos(0.083 * n)) / 344
        recorder.reads([(channel, int((start_s + n / 100) * SECOND_NS), line(first + n, echo_us))])


def record_event(recorder: Recorder, channel: int, at_s: float, event: Event) -> None:
    """Record an event of a port."""
    recorder.event(channel, int(at_s * SECOND_NS), event)


def comes_back(recorder: Recorder, before: int, channel: int, at_s: float, sensor: str = "identified") -> None:
    """Record that a port was lost a second ago and goes on in another channel."""
    record_event(recorder, before, at_s - 1, Lost(why="unplugged"))
    record_event(recorder, before, at_s, Replaced(channel=channel, sensor=sensor))
    record_event(recorder, channel, at_s, Continued(of=before, sensor=sensor))


def recording(path: Path, sensors: int = 1, port: str = "COM3") -> Recorder:
    """Begin a log."""
    entries = tuple(SensorEntry(channel, FAMILY, port, 115200) for channel in range(sensors))
    return Recorder(path, LogHeader(sensors=entries, mono_ns=0, unix_ns=0), VirtualClock(90 * SECOND_NS))


def codes(run: RunFile) -> set[str]:
    """Return the codes of a run's traps."""
    return {trap.code for trap in run.traps}


def test_each_long_part_has_a_run_file_with_a_time_of_its_own(tmp_path: Path) -> None:
    """The first part keeps the name; a short one stays in the log and is counted; each file holds the whole log."""
    log = tmp_path / "run.wire"
    with recording(log) as recorder:
        send(recorder, 0, 1.0, 15.0)
        comes_back(recorder, 0, 1, 20.0, "another")
        send(recorder, 1, 20.0, 3.0)
        comes_back(recorder, 1, 2, 30.0, "another")
        send(recorder, 2, 30.0, 40.0)
        record_event(recorder, 0, 70.0, RunEnded(by="seconds"))
    report = recover(log)
    assert [run.path.name for run in report.runs] == ["run.h5", "run.part3.h5"]
    assert [run.samples for run in report.runs] == [1500, 4000]
    assert report.main.path.name == "run.part3.h5"
    assert report.short_parts == pytest.approx((2.99,))
    assert any("2 parts; the longest is" in line and "run.part3.h5" in line for line in report.describe())
    with open_run(tmp_path / "run.h5") as first, open_run(tmp_path / "run.part3.h5") as third:
        assert first.originals() == third.originals()
        assert first.provenance["part"] == {"number": 1, "of": 3}
        assert (codes(first), codes(third)) == (set(), {"sensor_replaced"})
        for run in (first, third):
            t = run.samples().t
            assert abs(t[0]) < 0.01
            assert np.diff(t).max() < 0.011
        started = [run.provenance["clock_map"]["t0_mono_ns"] / SECOND_NS for run in (first, third)]
        assert started == pytest.approx([1.0, 30.0], abs=0.01)


def test_parts_of_several_sensors_are_told_apart(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The channel comes before the part; the sensor is chosen by its channel, and its longest part analysed."""
    log = tmp_path / "run.wire"
    with recording(log, sensors=2) as recorder:
        send(recorder, 0, 1.0, 12.0)
        send(recorder, 1, 1.0, 12.0)
        comes_back(recorder, 1, 2, 20.0)
        send(recorder, 2, 20.0, 20.0)
    assert [run.path.name for run in recover(log).runs] == ["run.0.h5", "run.1.h5", "run.1.part2.h5"]
    assert main(["analyse", str(log), "--no-report", "--channel", "1"]) == 0
    assert "its longest part, number 2" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("port", "sensor", "samples"),
    [("COM3", "identified", [1500, 2000]), ("COM3", "continued", [1500, 2000]), ("socket://b:1", "continued", [3500])],
)
def test_a_port_that_came_back_in_its_channel(tmp_path: Path, port: str, sensor: str, samples: list[int]) -> None:
    """As in logs of 0.2.0: a new part; on a network port whose counter runs on, a gap in the same part."""
    log = tmp_path / "run.wire"
    with recording(log, port=port) as recorder:
        send(recorder, 0, 1.0, 15.0)
        record_event(recorder, 0, 16.5, Lost(port=port, why="gone"))
        record_event(recorder, 0, 20.0, Reopened(port=port, gap_s=3.5, sensor=sensor))
        send(recorder, 0, 21.0, 20.0, first=2000)
    report = recover(log)
    assert [run.samples for run in report.runs] == samples
    with open_run(report.runs[0].path) as run:
        assert ("sensor_away" in codes(run)) == (len(samples) == 1)
        if len(samples) == 1:
            (gap,) = np.flatnonzero(run.samples().flags & Flag.GAP_BEFORE)
            assert run.samples().t[gap] - run.samples().t[gap - 1] == pytest.approx(5.01, abs=0.01)


def test_a_sensor_that_was_away_at_the_start_is_not_lost(tmp_path: Path) -> None:
    """Its first part begins when it comes; a sensor that is lost at the end is."""
    for name, lost_s in (("early", 0.5), ("late", 20.0)):
        log = tmp_path / f"{name}.wire"
        with recording(log) as recorder:
            record_event(recorder, 0, lost_s, Lost(why="unplugged"))
            send(recorder, 0, 5.0, 15.0)
            record_event(recorder, 0, 20.5, RunEnded(by="seconds"))
        (run,) = recover(log).runs
        assert (run.losses.gone_s is not None) == (name == "late")


def test_a_part_whose_beginning_is_damaged_is_found(tmp_path: Path) -> None:
    """If both events that open its channel are lost, its data are those of the only sensor."""
    log = tmp_path / "run.wire"
    with recording(log) as recorder:
        send(recorder, 0, 1.0, 15.0)
        comes_back(recorder, 0, 1, 20.0)
        send(recorder, 1, 20.0, 20.0)
    data = bytearray(log.read_bytes())
    for record in read_log(log):
        if record.kind is RecordKind.EVENT:
            data[record.offset + 30] ^= 1
    log.write_bytes(data)
    assert [run.samples for run in recover(log).runs] == [1500, 2000]
