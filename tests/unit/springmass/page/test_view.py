"""What the page is sent is what the log holds."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

import springmass
from acquisition.block import Block, SourceInfo
from acquisition.clock import VirtualClock
from acquisition.events import RunEnded, Triggered, Zeroed
from pipeline.track import Track
from springmass.loading.options import AnalysisOptions
from springmass.page.feeds import LogFeed, view_of
from springmass.page.live_analysis import motion_message
from springmass.runs.rolling import analysed, live_run
from storage.recorder import Recorder
from storage.wire_log.records import LogHeader, SensorEntry
from tests.wire import line

FAST = AnalysisOptions(accuracy="fast")


def track_of(feed: LogFeed) -> Track:
    """Return the samples so far as the page analyses them."""
    t, distance, flags, host_ns = feed.view.series[0][:]
    return feed.view.live_run(Block(0, t, distance, flags, host_ns), FAST).loaded.track


def test_the_fit_decays_as_its_law() -> None:
    """The curve that the page draws on from the last window is the motion itself, half a minute later too."""
    t = np.arange(3000) / 100
    gamma, omega = 0.02, 8.0
    y = 0.25 + 0.05 * np.exp(-gamma * t) * np.cos(omega * t) + 1e-5 * np.random.default_rng(4).standard_normal(t.size)
    samples, info = Block(0, t, y, np.zeros(t.size, np.uint8)), SourceInfo("live", "", 100.0, clock="device")
    fit = motion_message(analysed(live_run(samples, info, None, {}, FAST)))["fit"]
    later = np.arange(20.0, 60.0, 0.1)
    decay = fit["decay"]
    times = decay["from"] + decay["step"] * np.arange(len(decay["value"]))
    left = np.interp(later - fit["moment"], times, decay["value"])
    drawn = fit["rest"] + fit["amplitude"] * left * np.cos(fit["omega"] * (later - fit["moment"]) + fit["phase"])
    np.testing.assert_allclose(drawn, 0.25 + 0.05 * np.exp(-gamma * later) * np.cos(omega * later), atol=1e-3)


def put_samples(recorder: Recorder, numbers: range) -> None:
    """Put readings at 100 Hz of a swing of 50 mm."""
    for number in numbers:
        data = line(number, 2e6 * (0.3 + 0.05 * math.cos(0.083 * number)) / 344.0)
        recorder.reads([(0, number * 10_000_000 + 1_000_000 * (number % 3), data)])


def test_marks_and_triggers_wait_for_the_first_sample(tmp_path: Path) -> None:
    """Read before any sample they have no time yet; afterwards the time that the run file gives them."""
    header = LogHeader(sensors=(SensorEntry(0, "line-protocol"),), mono_ns=0, unix_ns=0, kind="live", title="bob")
    path = tmp_path / "run.wire"
    with Recorder(path, header, VirtualClock()) as recorder:
        feed = LogFeed(path)
        recorder.event(0, 500_000_000, Zeroed(rest_m=0.3, noise_m=2e-4))
        recorder.event(0, 3_000_000_000, Triggered(threshold_m=0.01, keep_s=2.0))
        recorder.mark("lamp on", host_ns=4_000_000_000)
        recorder.drain()
        feed.poll()
        assert (feed.view.marks, track_of(feed).trigger_s) == ([], None)
        for part in (range(100), range(100, 600)):
            put_samples(recorder, part)
            recorder.drain()
            feed.poll()
        assert list(feed.view.notes) == ["Zero 300.0 mm, noise 0.20 mm", "Trigger at 10 mm, 2 s kept"]
        assert feed.view.zero == {"rest_m": 0.3, "noise_m": 2e-4}
    loaded = springmass.load(path).loaded
    assert feed.view.marks == [(mark["t_s"], mark["text"]) for mark in loaded.provenance["marks"]]
    assert track_of(feed).trigger_s == loaded.track.trigger_s == pytest.approx(3.0, abs=0.01)
    assert view_of(loaded).zero == feed.view.zero
    feed.close()


def test_a_log_that_has_ended_is_analysed_on_the_page_as_anywhere_else(tmp_path: Path) -> None:
    """The page has the track of :func:`springmass.load`: clock, quantum, trigger and the last sample included."""
    header = LogHeader(sensors=(SensorEntry(0, "line-protocol"),), mono_ns=0, unix_ns=0, kind="live", title="bob")
    path = tmp_path / "run.wire"
    with Recorder(path, header, VirtualClock()) as recorder:
        put_samples(recorder, range(800))
        recorder.event(0, 2_000_000_000, Triggered(threshold_m=0.01, keep_s=2.0))
        recorder.event(0, 8_000_000_000, RunEnded(by="seconds"))
    feed = LogFeed(path)
    feed.poll()
    assert feed.view.ended
    shown, loaded = track_of(feed), springmass.load(path).loaded.track
    for each in dataclasses.fields(Track):
        np.testing.assert_array_equal(getattr(shown, each.name), getattr(loaded, each.name), err_msg=each.name)
    assert shown.trigger_s is not None
    feed.close()
