"""Cycles are found where there are any, at their frequency, and cut into windows that cover the record once."""

from __future__ import annotations

from types import ModuleType

import numpy as np
import pytest

from pipeline.samples.condition import condition
from pipeline.track import Track
from pipeline.windows.cycles import Cycles, NoOscillation, Params, find_cycles


def cycles_of(t: np.ndarray, y: np.ndarray, *, rate_hz: float | None = None) -> Cycles:
    """Return the cycles of a record that has some."""
    found = find_cycles(condition(Track.from_arrays(t, y, rate_hz=rate_hz)))
    assert isinstance(found, Cycles), found
    return found


@pytest.mark.parametrize("omega", [2.0, 3.0, 8.3, 20.0, 60.0])
@pytest.mark.parametrize("sigma_m", [1e-5, 2.39e-3])
def test_frequency_of_ten_seconds(synthetic: ModuleType, omega: float, sigma_m: float) -> None:
    """The frequency is good to a twentieth of the record's line width."""
    t = synthetic.times(10)
    found = cycles_of(t, synthetic.noisy(synthetic.Truth(omega=omega), t, sigma_m, 1))
    assert found.frequency_hz == pytest.approx(omega / (2 * np.pi), abs=0.05 / 10.0 + 1e-4 * omega)
    assert found.count == pytest.approx(10.0 * omega / (2 * np.pi), rel=0.01, abs=0.06)


def test_noise_beyond_the_amplitude_still_shows_the_line(synthetic: ModuleType) -> None:
    """At 1.8 amplitudes of noise every record of 10 s shows its line; at 2.2 (-10 dB) none shows a wrong one."""
    t = synthetic.times(10)
    for sigma_m, always in ((0.09, True), (0.11, False)):
        for seed in range(40):
            track = Track.from_arrays(t, synthetic.noisy(synthetic.Truth(), t, sigma_m, seed))
            found = find_cycles(condition(track))
            if always or isinstance(found, Cycles):
                assert isinstance(found, Cycles)
                assert found.frequency_hz == pytest.approx(8.3 / (2 * np.pi), abs=0.05)


@pytest.mark.parametrize("seconds", [2.0, 10.0, 31.7])
@pytest.mark.parametrize("rate_hz", [12.0, 60.0, 100.0, 1000.0])
def test_windows_cover_the_record_once(synthetic: ModuleType, seconds: float, rate_hz: float) -> None:
    """Windows follow each other without gap or overlap, hold whole periods and enough samples each."""
    t = synthetic.times(seconds, rate_hz)
    found = cycles_of(t, synthetic.noisy(synthetic.Truth(), t, 1e-4, 2))
    lengths = np.diff(found.bounds)
    assert (found.bounds[0], found.bounds[-1]) == (0, t.size)
    assert np.ptp(lengths) <= 1
    assert lengths.min() >= Params().samples_per_window - 1
    periods = lengths.mean() / rate_hz * 8.3 / (2 * np.pi)
    assert periods >= 0.99
    assert periods < 2.1 * max(1.0, np.ceil(Params().samples_per_window * 8.3 / (2 * np.pi) / rate_hz))


def test_flagged_samples_are_bridged(synthetic: ModuleType) -> None:
    """A quarter of the samples missing in blocks does not move the frequency beyond its line."""
    t = synthetic.times(20)
    y = synthetic.noisy(synthetic.Truth(), t, 3e-4, 3)
    for first in range(100, 1900, 400):
        y[first : first + 100] = np.nan
    assert cycles_of(t, y).frequency_hz == pytest.approx(8.3 / (2 * np.pi), abs=0.005)


def test_drift_is_not_the_oscillation(synthetic: ModuleType) -> None:
    """A steady slope ten times the amplitude high is drift."""
    t = synthetic.times(10)
    y = synthetic.noisy(synthetic.Truth(), t, 3e-4, 4) + 0.05 * t
    assert cycles_of(t, y).frequency_hz == pytest.approx(8.3 / (2 * np.pi), abs=0.02)


@pytest.mark.parametrize("origin_s", [0.0, 5.04, 1e4, 1.7e9])
def test_time_origin_does_not_matter(synthetic: ModuleType, origin_s: float) -> None:
    """A record counts from anywhere."""
    t = synthetic.times(10)
    y = synthetic.noisy(synthetic.Truth(), t, 3e-4, 5)
    here, there = cycles_of(t, y), cycles_of(t + origin_s, y, rate_hz=100.0)
    np.testing.assert_array_equal(here.bounds, there.bounds)
    assert there.frequency_hz == pytest.approx(here.frequency_hz, rel=1e-6)


STILL = {
    "constant": lambda t, _: np.full(t.size, 0.2),
    "one tick": lambda t, rng: 0.2 + 4.3e-5 * (rng.random(t.size) < 0.5),
    "white noise": lambda t, rng: 0.2 + 1e-3 * rng.standard_normal(t.size),
    "ramp": lambda t, rng: 0.2 + 0.01 * t + 1e-4 * rng.standard_normal(t.size),
    "one period": lambda t, rng: 0.2 + 0.05 * np.cos(2 * np.pi * t / t[-1]) + 1e-4 * rng.standard_normal(t.size),
}


@pytest.mark.parametrize("what", STILL)
def test_what_does_not_oscillate_is_said_so(what: str) -> None:
    """A fixed object, noise, a ramp and a single period are no oscillation, and the reason is a sentence."""
    t = np.arange(1000) / 100
    y = STILL[what](t, np.random.default_rng(6))
    found = find_cycles(condition(Track.from_arrays(t, y, quantum_m=4.3e-5)))
    assert isinstance(found, NoOscillation)
    assert len(found.why.split()) > 4


def test_white_noise_is_hardly_ever_an_oscillation() -> None:
    """None of 300 records of white noise passes where one in a million should."""
    t = np.arange(1000) / 100
    for seed in range(300):
        track = Track.from_arrays(t, np.random.default_rng(seed).standard_normal(1000))
        assert isinstance(find_cycles(condition(track)), NoOscillation)


def test_thin_records_are_refused_in_words() -> None:
    """A few samples spread over a day have no period to be found, and that does not take a day of memory."""
    t = np.array([0.0, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 86400.0])
    found = find_cycles(condition(Track.from_arrays(t, np.sin(np.arange(10.0)))))
    assert isinstance(found, NoOscillation)
    assert "too thin" in found.why


def test_rows_without_a_distance_are_no_slow_motion(synthetic: ModuleType) -> None:
    """A third of the record without distances, bridged by a straight line, does not hide the oscillation."""
    t = synthetic.times(30.0)
    y = synthetic.noisy(synthetic.Truth(gamma=0.02), t, 3e-4, 1)
    for first in np.arange(8.9, 9.7, 0.1):
        found = find_cycles(condition(Track.from_arrays(t, np.where((t > first) & (t < first + 9.0), np.nan, y))))
        assert isinstance(found, Cycles)
        assert found.frequency_hz == pytest.approx(8.3 / (2 * np.pi), abs=0.02)
