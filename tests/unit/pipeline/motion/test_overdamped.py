"""Overdamped motions give their rates; what only looks like one is not taken for one."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm

from pipeline.analyse import Overdamped, analyse
from pipeline.bench.scene import Scene
from pipeline.track import Track
from tests.sampling import sampled

OMEGA = 8.3  # undamped, rad/s
T = np.arange(1000) / 100.0
SPRING = Scene.from_mapping({"bob": {"mass_kg": {"value": 0.2, "u": 5e-5}}})


def released(ratio: float, t: np.ndarray = T, start_m: float = 0.05, speed: float = 0.0) -> np.ndarray:
    """Return the displacement of a linearly damped bob by the exponential of its matrix, step by step, m."""
    matrix = np.array([[0.0, 1.0], [-(OMEGA**2), -2.0 * ratio * OMEGA]])
    step, state = expm(matrix * (t[1] - t[0])), np.array([start_m, speed])
    found = np.empty(t.size)
    for k in range(t.size):
        found[k] = state[0]
        state = step @ state
    return found


def track(y: np.ndarray, sigma_m: float, seed: int, t: np.ndarray = T) -> Track:
    """Return a record with white noise about a rest position of 220 mm."""
    return Track.from_arrays(t, 0.22 + y + sigma_m * np.random.default_rng(seed).standard_normal(t.size))


@pytest.mark.parametrize("seed", sampled(range(10)))
@pytest.mark.parametrize("ratio", [1.1, 1.5, 2.0])
def test_overdamped_records_give_both_rates(ratio: float, seed: int) -> None:
    """Both rates lie within four of their uncertainties."""
    root = math.sqrt(ratio**2 - 1.0)
    found = analyse(track(released(ratio), 3e-4, seed)).estimates
    for name, rate in (("slow", (ratio - root) * OMEGA), ("fast", (ratio + root) * OMEGA)):
        estimate = found[f"relaxation_rate_{name}"]
        assert abs(estimate.value - rate) < 4.0 * estimate.u, name
        assert estimate.unit == "1/s"


@pytest.mark.parametrize("seed", sampled(range(10)))
def test_critical_records_give_one_rate(seed: int) -> None:
    """At critical damping the one rate is that of the undamped oscillation; both rates are given if it is not seen."""
    found = analyse(track(released(1.0), 3e-4, seed)).estimates
    if "relaxation_rate" in found:
        assert abs(found["relaxation_rate"].value - OMEGA) < 4.0 * found["relaxation_rate"].u
    else:
        assert {"relaxation_rate_slow", "relaxation_rate_fast"} <= set(found)


@pytest.mark.parametrize("seed", sampled(range(8)))
@pytest.mark.parametrize("ratio", [0.06, 0.1, 0.3, 0.5, 0.7])
def test_strongly_damped_oscillations_give_frequency_and_rate(ratio: float, seed: int) -> None:
    """Few cycles are enough: damping rate, damped frequency, amplitude, phase and Q lie within 4 u."""
    damped = OMEGA * math.sqrt(1.0 - ratio**2)
    true = {"damping_rate": ratio * OMEGA, "angular_frequency": damped, "period": 2 * math.pi / damped}
    true |= {"amplitude": 0.05 * OMEGA / damped, "phase": -math.asin(ratio), "quality_factor": 0.5 / ratio}
    found = analyse(track(released(ratio), 1e-3, seed)).estimates
    for name, value in true.items():
        assert abs(found[name].value - value) < 4.0 * found[name].u, name


def test_a_push_does_not_disturb() -> None:
    """A bob that is pushed has the same rates."""
    slow = analyse(track(released(1.5, speed=-0.3), 3e-4, 1)).estimates["relaxation_rate_slow"]
    assert slow.value == pytest.approx((1.5 - math.sqrt(1.25)) * OMEGA, abs=4.0 * slow.u + 0.03)


SHAPES = {
    "noise": np.zeros(1000),
    "step": np.where(T > 4.0, 0.02, 0.0),
    "early step": np.where(T > 0.3, 0.02, 0.0),
    "line": 0.002 * T,
    "parabola": 2e-4 * T**2,
    "ramp": 0.02 * np.clip(T - 3.0, 0.0, 1.0),
    "smooth move": 0.01 * np.tanh(2.0 * (T - 5.0)),
    "wandering": 1e-3 * np.cumsum(np.random.default_rng(3).standard_normal(1000)) / 10.0,
    "one exponential": 0.02 * np.exp(-0.8 * T),
}


@pytest.mark.parametrize("sigma_m", [3e-4, 2.39e-3])
@pytest.mark.parametrize("name", SHAPES)
def test_other_motions_are_no_relaxation(name: str, sigma_m: float) -> None:
    """Noise, steps, drifts, ramps, moves and a lone exponential have no rate."""
    result = analyse(track(SHAPES[name], sigma_m, 5))
    assert not any(each.startswith("relaxation") for each in result.estimates)
    assert "overdamped" not in {finding.code for finding in result.findings}


def test_an_analysis_says_what_it_found() -> None:
    """Overdamped records carry a finding with both rates, estimates and a spring constant, and no error."""
    result = analyse(track(released(1.5), 3e-4, 1), SPRING)
    assert isinstance(result.motion, Overdamped)
    assert [f.severity for f in result.findings if f.code == "overdamped"] == ["warning"]
    assert {"relaxation_rate_slow", "relaxation_rate_fast"} <= set(result.estimates)
    assert not any(f.severity == "error" for f in result.findings)
    k = result.estimates["spring_constant"]
    assert k.value == pytest.approx(0.2 * OMEGA**2, abs=4.0 * k.u)


@pytest.mark.parametrize("ratio", [0.01, 0.03, 0.1, 0.4])
def test_the_spring_constant_is_that_of_the_undamped_motion(ratio: float) -> None:
    """However strong the damping, k belongs to the undamped frequency and not to the damped one."""
    result = analyse(track(released(ratio), 1e-4, 2), SPRING)
    k = result.estimates["spring_constant"]
    assert k.value == pytest.approx(0.2 * OMEGA**2, abs=4.0 * k.u)
    assert ("strongly_damped" in {f.code for f in result.findings}) == (ratio > 0.05)
