"""The band of a scene's uncertainties: against linear propagation, and refused."""

import math
from typing import Any

import numpy as np
import pytest

from pipeline.bench.scene import Scene
from pipeline.errors import DynamicsError
from pipeline.simulation.band import spread

LINEAR: dict[str, Any] = {
    "bob": {"mass_kg": {"value": 0.2, "u": 2e-5}},
    "spring": {"mass_kg": {"value": 0.01, "u": 1e-4}, "constant_n_per_m": {"value": 20.0, "u": 2e-3}},
    "start": {"displacement_m": {"value": 0.05, "u": 1e-4}, "velocity_m_per_s": {"value": 0.1, "u": 2e-3}},
    "damping": {"gamma_per_s": {"value": 0.05, "u": 5e-4}},
}
SECONDS = 20.0


def displacement(t: np.ndarray, mass: float, spring: float, k: float, y: float, v: float, gamma: float) -> np.ndarray:
    """Return the closed form of a linear scene's motion."""
    omega = math.sqrt(k / (mass + spring / 3.0) - gamma**2)
    return np.exp(-gamma * t) * (y * np.cos(omega * t) + (v + gamma * y) / omega * np.sin(omega * t))


def test_a_linear_scene_has_the_band_of_linear_propagation() -> None:
    """The quantiles are those of a normal distribution, whose sigma is the closed form's derivatives times each u."""
    band = spread(Scene.from_mapping(LINEAR), SECONDS, members=4000)
    values = np.array([0.2, 0.01, 20.0, 0.05, 0.1, 0.05])
    us = np.array([2e-5, 1e-4, 2e-3, 1e-4, 2e-3, 5e-4])
    variance = np.zeros(band.t.size)
    for value, u, column in zip(values, us, np.eye(values.size), strict=True):
        step = 1e-4 * value
        ahead, behind = (displacement(band.t, *(values + sign * step * column)) for sign in (1.0, -1.0))
        variance += ((ahead - behind) / (2.0 * step) * u) ** 2
    sigma = np.sqrt(variance)
    for found, quantile in zip(band.of_displacement, (-1.95996, -1.0, 1.0, 1.95996), strict=True):
        np.testing.assert_allclose(found, quantile * sigma, rtol=0, atol=0.1 * np.max(sigma))
        assert np.dot(found, sigma) / np.dot(sigma, sigma) == pytest.approx(quantile, rel=0.03)
    assert band.t[-1] >= SECONDS


def test_what_has_no_band_is_refused() -> None:
    """A mass that may be 0, and a run too long to draw, are one line each."""
    vague = Scene.from_mapping({**LINEAR, "bob": {"mass_kg": {"value": 0.2, "u": 0.1}}})
    with pytest.raises(DynamicsError, match="mass_kg"):
        spread(vague, 1.0)
    with pytest.raises(DynamicsError):
        spread(Scene.from_mapping(LINEAR), 1e5)
