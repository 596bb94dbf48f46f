"""Relaxation motions give their rates; what only looks like one is not taken for one."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

from pipeline.analyse import analyse
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


@pytest.mark.parametrize("ratio", [0.01, 0.03, 0.1, 0.4])
def test_the_spring_constant_is_that_of_the_undamped_motion(ratio: float) -> None:
    """However strong the damping, k belongs to the undamped frequency and not to the damped one."""
    result = analyse(track(released(ratio), 1e-4, 2), SPRING)
    k = result.estimates["spring_constant"]
    assert k.value == pytest.approx(0.2 * OMEGA**2, abs=4.0 * k.u)
    assert ("strongly_damped" in {f.code for f in result.findings}) == (ratio > 0.05)
