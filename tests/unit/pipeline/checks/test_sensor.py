"""A sensor that holds or smooths its distances is measured, and enters the uncertainties."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.analyse import Analysis, Oscillation, Still, analyse
from pipeline.checks.sensor import held_count
from pipeline.findings.finding import Finding
from pipeline.samples.condition import condition
from pipeline.track import F8, Track

OMEGA, AMPLITUDE, REST = 8.3, 0.05, 0.3
T: F8 = np.arange(2000) / 100.0


def displaced(t: F8 = T) -> F8:
    """Return a bob's displacement, weakly damped."""
    return AMPLITUDE * np.exp(-0.01 * t) * np.cos(OMEGA * t + 0.4)


def noise(seed: int, size: int = T.size, sigma_m: float = 3e-4) -> F8:
    """Return white noise."""
    return sigma_m * np.random.default_rng(seed).standard_normal(size)


def analysed(y: F8, t: F8 = T) -> Analysis:
    """Return the analysis of distances."""
    return analyse(Track.from_arrays(t, y))


def warned(result: Analysis) -> dict[str, Finding]:
    """Return all findings but notes by code."""
    return {finding.code: finding for finding in result.findings if finding.severity != "info"}


@pytest.mark.parametrize("size", [5, 15, 31])
def test_a_running_mean_is_measured(size: int) -> None:
    """Behind a running mean the delay is right to two fifths, and the amplitude is covered."""
    t = np.arange(2200) / 100.0
    whole = REST + displaced(t) + noise(size, t.size)
    result = analysed(np.convolve(whole, np.full(size, 1.0 / size), "valid"), t[size - 1 :])
    values = warned(result)["smoothed_sensor"].values
    half = 0.5 * size * OMEGA / 100.0
    assert values["late_s"] == pytest.approx(0.5 * (size - 1) / 100.0, rel=0.4)
    assert 0.3 < values["amplitude_loss"] / (1.0 - math.sin(half) / half) < 1.5
    assert 0.4 < values["correlation"] < 1.0
    found, true = result.estimates["amplitude"], AMPLITUDE * math.exp(-0.01 * t[size - 1])
    assert abs(found.value - true) < 3.0 * found.u
    assert isinstance(result.motion, Oscillation)
    lines = result.motion.derived.budgets["amplitude"].contributions
    assert sum(line.share for line in lines if line.name == "sensor_smoothing") > 0.5


def test_a_first_order_lag_is_measured() -> None:
    """Behind a lag of 0.03 s the motion is late by about that, and the amplitude is covered."""
    t = np.arange(2300) / 100.0
    whole, y = REST + displaced(t) + noise(4, t.size), np.empty(t.size)
    held, each = whole[0], 1.0 - math.exp(-1.0 / 3.0)
    for k, value in enumerate(whole):
        held += each * (value - held)
        y[k] = held
    result = analysed(y[300:], t[300:])
    assert warned(result)["smoothed_sensor"].values["late_s"] == pytest.approx(0.03, rel=0.35)
    found = result.estimates["amplitude"]
    assert abs(found.value - AMPLITUDE * math.exp(-0.03)) < 4.0 * found.u


@pytest.mark.parametrize("step_m", [0.0, 0.001])
def test_held_distances_are_counted(step_m: float) -> None:
    """Distances of a sensor of 25 Hz at 100 Hz are repeated four times, in steps or not."""
    y = REST + displaced() + noise(5)
    y = np.round(y / step_m) * step_m if step_m else y
    result = analysed(y[np.arange(T.size) // 4 * 4])
    values = warned(result)["held_samples"].values
    assert (values["count"], values["interval_s"]) == (4, pytest.approx(0.04))
    assert abs(result.estimates["amplitude"].value - AMPLITUDE) < 4.0 * result.estimates["amplitude"].u


def test_coarse_steps_alone_are_not_held() -> None:
    """Distances in steps of 3 mm repeat, but change at any row."""
    y = np.round((REST + displaced() + noise(6)) / 0.003) * 0.003
    assert held_count(condition(Track.from_arrays(T, y))) == 1
    values = warned(analysed(y))["quantised"].values
    assert values["step_m"] == pytest.approx(0.003)


def test_a_still_recording_with_held_distances_has_both_findings() -> None:
    """A recording without motion reports too that its distances are repeated."""
    result = analysed((REST + noise(7))[np.arange(T.size) // 5 * 5])
    assert isinstance(result.motion, Still)
    assert warned(result)["held_samples"].values["count"] == 5
    assert "no_oscillation" in warned(result)


def test_a_rest_position_between_two_steps_is_known_to_the_step() -> None:
    """Where every distance is the same but for a few flips, the mean is known to the rounding and no better."""
    y = np.full(T.size, 0.3)
    y[::400] += 0.001
    assert analysed(y).estimates["offset"].u >= 0.001 / math.sqrt(12.0)


@pytest.mark.parametrize("step_m", [0.0, 1e-4])
@pytest.mark.parametrize("reading_hz", [9.0, 20.0])
def test_joined_readings_are_named_and_covered(step_m: float, reading_hz: float) -> None:
    """Readings of a slow sensor, joined by straight lines and printed or not, make the amplitude too small."""
    slow = np.arange(0.0, T[-1] + 1.0, 1.0 / reading_hz)
    y = np.interp(T, slow, REST + displaced(slow) + noise(8, slow.size, 1e-4))
    y = np.round(y / step_m) * step_m if step_m else y
    result = analysed(y)
    half = 0.5 * OMEGA / reading_hz
    assert warned(result)["smoothed_sensor"].values["amplitude_loss"] == pytest.approx(
        1.0 - (math.sin(half) / half) ** 2, rel=0.05
    )
    assert abs(result.estimates["amplitude"].value - AMPLITUDE) < 4.0 * result.estimates["amplitude"].u


@pytest.mark.parametrize("seed", range(20))
def test_rounded_distances_are_not_taken_for_joined_readings(seed: int) -> None:
    """Second differences of a slow motion that is rounded as coarsely as its noise are rounding errors, mostly."""
    y = np.round((REST + displaced() + noise(seed, sigma_m=1e-4)) / 1e-4) * 1e-4
    assert "smoothed_sensor" not in warned(analysed(y))
