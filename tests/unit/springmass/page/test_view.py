"""What the page is sent is what the log holds."""

from __future__ import annotations

import dataclasses
import json
import struct
from pathlib import Path

import numpy as np
import pytest

import springmass
from acquisition.block import Block
from acquisition.clock import VirtualClock
from acquisition.decoders.registry import get_family
from pipeline.bench.scene import Scene
from pipeline.track import Track
from springmass.page.feeds import LogFeed, view_of
from springmass.page.live_analysis import Watcher, drawn, motion_of, spectrum
from springmass.page.view import MOST_PER_MESSAGE, Series, json_of
from springmass.runs.loading import between
from storage.recorder import Recorder
from storage.wire_log.records import LogHeader, SensorEntry


def test_messages_hold_every_sample_once() -> None:
    """In order, a missing one as NaN, however many come at a time."""
    count = 2 * MOST_PER_MESSAGE + 17
    t = np.arange(count) / 100
    y = np.where(np.arange(count) % 7, 0.2 + 1e-3 * t, np.nan)
    series = Series()
    for start in range(0, count, 999):
        part = slice(start, start + 999)
        series.push(Block(start, t[part], y[part], np.zeros(t[part].size, np.uint8)))
        assert series.missing() == np.count_nonzero(np.isnan(y[: len(series)]))
    found_t, found_y, first = [], [], 0
    while first < len(series):
        message = series.message(3, first)
        kind, sensor, start, size = struct.unpack_from("<4I", message)
        assert (kind, sensor, start) == (1, 3, first)
        values = np.frombuffer(message, "<f8", offset=16)
        found_t.append(values[:size])
        found_y.append(values[size:])
        first += size
    np.testing.assert_array_equal(np.concatenate(found_t), t)
    np.testing.assert_array_equal(np.concatenate(found_y), y)


def test_a_log_is_seen_as_it_grows(tmp_path: Path) -> None:
    """Samples, marks at the record's own times, and what befell the recording; ended once the log is."""
    header = LogHeader(sensors=(SensorEntry(0, "maxbotix-hr"),), mono_ns=0, unix_ns=0, kind="live", title="bob")
    with Recorder(tmp_path / "run.wire", header, VirtualClock()) as recorder:
        feed = LogFeed(tmp_path / "run.wire")
        for number in range(50):
            recorder.put(0, number * 100_000_000, b"R%04d\r" % (300 + number))
        recorder.mark("released", host_ns=2_000_000_000)
        recorder.event(0, 2_500_000_000, "timeout", {"after_s": 1.0})
        recorder.drain()
        feed.poll()
        assert (feed.view.source, feed.view.title) == ("LIVE", "bob")
        seen = len(feed.view.series[0])
        assert seen >= 48
        ((moment, text),) = feed.view.marks
        assert text == "released"
        assert moment == pytest.approx(2.0, abs=0.2)
        assert feed.view.notes == ["timeout: after_s 1"]
        assert not feed.view.ended
    feed.poll()
    assert feed.view.ended
    assert feed.view.error == ""
    feed.close()


def test_the_motion_of_a_run_is_that_of_an_analysis() -> None:
    """The same numbers as ``analyse`` at ``fast``, with the law's curve through the amplitudes."""
    loaded = springmass.load(springmass.sample_data() / "damped_simulated_position.txt")
    view = view_of(loaded)
    assert len(view.series[0]) == len(loaded.samples)
    message = motion_of(loaded.track, Scene(), 20e-6)
    found = message["estimates"]
    assert found["period"]["value"] == pytest.approx(0.790066, abs=5 * found["period"]["u"])
    assert message["stop"]["low"] < 0.790066 < message["stop"]["high"]
    law = next(each for each in message["laws"] if each["name"] == message["law"])
    curve = np.interp(message["amplitude"]["t"], law["t"], law["value"])
    assert np.median(np.abs(curve / message["amplitude"]["value"] - 1.0)) < 0.01


def test_what_does_not_move_is_said() -> None:
    """In the analysis's own words, with the spectrum of what is there."""
    rng = np.random.default_rng(3)
    t = np.arange(2000) / 100
    track = springmass.Track.from_arrays(t, 0.3 + 1e-4 * rng.standard_normal(2000))
    message = motion_of(track, Scene(), 20e-6)
    assert message["why"]
    assert "period" not in message["estimates"]
    assert len(message["spectrum"]["f"]) == len(message["spectrum"]["value"]) > 100


def test_a_line_of_the_spectrum_has_its_amplitude() -> None:
    """At its frequency, whatever is missing."""
    t = np.arange(8192) / 100
    y = 0.2 + 0.05 * np.cos(2 * np.pi * (t[1] ** -1 * 100 / 8192) * t)
    y[::500] = np.nan
    found = spectrum(springmass.Track.from_arrays(t, y))
    peak = int(np.argmax(found["value"]))
    assert found["value"][peak] == pytest.approx(0.05, rel=0.02)
    assert found["f"][peak] == pytest.approx(100 * 100 / 8192, abs=0.06)


@pytest.mark.parametrize(("far", "direction"), [(False, "away"), (True, "nearer")])
def test_what_cuts_the_motion_says_how_far_to_move(far: bool, direction: str) -> None:
    """50 mm of swing cut at 35: what is lost and a centimetre to spare, away from the near end or nearer to the far."""
    t = np.arange(3000) / 100
    y = 0.25 + 0.05 * np.exp(-0.005 * t) * np.cos(8.0 * t) + 3e-4 * np.random.default_rng(2).standard_normal(t.size)
    y = np.minimum(y, 0.285) if far else np.maximum(y, 0.215)
    message = motion_of(Track(t, y, np.zeros(t.size, np.uint8), 100.0, clock="device"), Scene.from_mapping({}))
    (finding,) = (each for each in message["findings"] if each["code"] == "clipped")
    assert finding["advice"] == f"Move the sensor 3 cm {direction}."


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e6])
def test_curves_are_told_to_seven_digits(size: float) -> None:
    """Of any size; what is no number stays none, and JSON calls it null."""
    values = size * np.concatenate([np.random.default_rng(5).standard_normal(500), [0.0, np.nan, np.inf]])
    curve = drawn(values)
    np.testing.assert_allclose(curve, values, rtol=6e-7)
    text = json_of(curve)
    assert text.endswith("0.0, null, null]")
    assert len(text) < 16 * len(curve)


def test_a_bob_at_rest_has_numbers_too() -> None:
    """Rest position, noise, rate and the share of drop-outs, each with its uncertainty; one in ten is missing."""
    t = np.arange(1000) / 100
    y = 0.25 + 3e-4 * np.random.default_rng(3).standard_normal(t.size)
    y[::10] = np.nan
    message = motion_of(Track(t, y, np.zeros(t.size, np.uint8), 100.0, clock="device"), Scene.from_mapping({}))
    found = message["estimates"]
    assert message["why"]
    assert found["drop_outs"]["value"] == pytest.approx(10.0)
    assert found["drop_outs"]["u"] == pytest.approx(100.0 * np.sqrt(0.1 * 0.9 / 1000), rel=0.02)
    assert found["sample_rate"]["value"] == pytest.approx(100.0)
    assert found["sample_rate"]["u"] > 1e-3
    assert found["noise"]["value"] == pytest.approx(3e-4, rel=0.1)


def test_the_fit_decays_as_its_law() -> None:
    """The curve that the page draws on from the last window is the motion itself, half a minute later too."""
    t = np.arange(3000) / 100
    gamma, omega = 0.02, 8.0
    y = 0.25 + 0.05 * np.exp(-gamma * t) * np.cos(omega * t) + 1e-5 * np.random.default_rng(4).standard_normal(t.size)
    fit = motion_of(Track(t, y, np.zeros(t.size, np.uint8), 100.0, clock="device"), Scene.from_mapping({}))["fit"]
    later = np.arange(20.0, 60.0, 0.1)
    decay = fit["decay"]
    times = decay["from"] + decay["step"] * np.arange(len(decay["value"]))
    left = np.interp(later - fit["moment"], times, decay["value"])
    drawn = fit["rest"] + fit["amplitude"] * left * np.cos(fit["omega"] * (later - fit["moment"]) + fit["phase"])
    np.testing.assert_allclose(drawn, 0.25 + 0.05 * np.exp(-gamma * later) * np.cos(omega * later), atol=1e-3)


def put_samples(recorder: Recorder, numbers: range) -> None:
    """Put readings at 100 Hz of a swing of 50 mm."""
    encoder = get_family("line-protocol").encoder()
    for number in numbers:
        distance_m = 0.3 + 0.05 * float(np.cos(0.083 * number))
        frame = encoder.encode(
            sequence=number,
            device_us=10_000 * number,
            echo_us=2e6 * distance_m / 344.0,
            distance_m=distance_m,
            temperature_c=20.0,
        )
        recorder.put(0, number * 10_000_000 + 1_000_000 * (number % 3), frame)


def test_marks_and_triggers_wait_for_the_first_sample(tmp_path: Path) -> None:
    """Read before any sample they have no time yet; afterwards the time that the run file gives them."""
    header = LogHeader(sensors=(SensorEntry(0, "line-protocol"),), mono_ns=0, unix_ns=0, kind="live", title="bob")
    path = tmp_path / "run.wire"
    with Recorder(path, header, VirtualClock()) as recorder:
        feed = LogFeed(path)
        recorder.event(0, 500_000_000, "still", {"rest_m": 0.3, "noise_m": 2e-4})
        recorder.event(0, 3_000_000_000, "trigger", {"threshold_m": 0.01, "keep_s": 2.0})
        recorder.mark("lamp on", host_ns=4_000_000_000)
        recorder.drain()
        feed.poll()
        assert (feed.view.marks, feed.view.track().trigger_s) == ([], None)
        for part in (range(100), range(100, 600)):
            put_samples(recorder, part)
            recorder.drain()
            feed.poll()
        assert feed.view.notes == ["Zero 300.0 mm, noise 0.20 mm", "Trigger at 10 mm, 2 s kept"]
        assert feed.view.zero == {"rest_m": 0.3, "noise_m": 2e-4}
    loaded = springmass.load(path)
    assert feed.view.marks == [(mark["t_s"], mark["text"]) for mark in loaded.provenance["marks"]]
    assert feed.view.track().trigger_s == loaded.track.trigger_s == pytest.approx(3.0, abs=0.01)
    assert view_of(loaded).zero == feed.view.zero
    feed.close()


def test_peaks_of_the_spectrum_are_lines_and_not_noise() -> None:
    """Two swings give two peaks at their frequencies and amplitudes; noise alone gives none in 49 of 50 spectra."""
    rng = np.random.default_rng(11)
    t = np.arange(8192) / 100
    y = (
        0.3
        + 0.02 * np.cos(2 * np.pi * 1.3 * t)
        + 0.002 * np.cos(2 * np.pi * 2.9 * t)
        + 1e-4 * rng.standard_normal(t.size)
    )
    peaks = spectrum(Track.from_arrays(t, y))["peaks"]
    assert [peak["f"] for peak in peaks] == pytest.approx([1.3, 2.9], abs=3e-4)
    assert [peak["value"] for peak in peaks] == pytest.approx([0.02, 0.002], rel=0.2)
    noise = [spectrum(Track.from_arrays(t, rng.standard_normal(t.size)))["peaks"] for _ in range(50)]
    assert sum(map(bool, noise)) <= 1


def test_a_moment_has_the_numbers_of_its_samples_and_no_forecast() -> None:
    """Half way through a run the page shows what the samples so far amount to, and not how long to go on."""
    loaded = springmass.load(springmass.sample_data() / "damped_simulated_position.txt")
    watcher = Watcher(view_of(loaded), loaded.scene, None)
    try:
        found = json.loads(watcher.moment(40.0))
    finally:
        watcher.close()
    expected = motion_of(between(loaded.track, -np.inf, 40.0), Scene())
    assert (found["type"], found["to"], found["accuracy"]) == ("moment", 40.0, "fast")
    assert found["estimates"] == json.loads(json_of(expected["estimates"]))
    assert found["t_s"] <= 40.0
    assert "stop" not in found


def test_a_log_that_has_ended_is_analysed_on_the_page_as_anywhere_else(tmp_path: Path) -> None:
    """The page has the track of :func:`springmass.load`: clock, quantum, trigger and the last sample included."""
    header = LogHeader(sensors=(SensorEntry(0, "line-protocol"),), mono_ns=0, unix_ns=0, kind="live", title="bob")
    path = tmp_path / "run.wire"
    with Recorder(path, header, VirtualClock()) as recorder:
        put_samples(recorder, range(800))
        recorder.event(0, 2_000_000_000, "trigger", {"threshold_m": 0.01, "keep_s": 2.0})
        recorder.event(0, 8_000_000_000, "ended", {"by": "seconds"})
    feed = LogFeed(path)
    feed.poll()
    assert feed.view.ended
    shown, loaded = feed.view.track(), springmass.load(path).track
    for each in dataclasses.fields(Track):
        np.testing.assert_array_equal(getattr(shown, each.name), getattr(loaded, each.name), err_msg=each.name)
    assert shown.trigger_s is not None
    feed.close()
