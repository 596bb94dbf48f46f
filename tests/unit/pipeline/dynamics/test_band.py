"""The band of a scene's uncertainties: against linear propagation, and refused."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from pipeline.bench.scene import Scene
from pipeline.dynamics.band import spread
from pipeline.errors import DynamicsError

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


def test_one_uncertain_amplitude_is_the_band_of_the_start() -> None:
    """Where only the start is uncertain the band is its quantiles, less by as much as the motion has lost since."""
    scene = Scene.from_mapping({**LINEAR, "bob": {"mass_kg": 0.2}, "spring": {"constant_n_per_m": 20.0}})
    scene = Scene.from_mapping({**scene.to_mapping(), "start": LINEAR["start"] | {"velocity_m_per_s": 0.0}})
    scene = Scene.from_mapping({**scene.to_mapping(), "damping": {"gamma_per_s": 0.05}})
    band = spread(scene, SECONDS)
    t = np.array([0.0, 3.0, 20.0])
    middle, quantiles = band.amplitude_at(t)
    np.testing.assert_allclose(middle, 0.05 * np.exp(-0.05 * t), rtol=0.01)
    widths = quantiles - middle
    np.testing.assert_allclose(widths[:, 0], 1e-4 * np.array([-1.96, -1.0, 1.0, 1.96]), rtol=0.02)
    np.testing.assert_allclose(widths / widths[:, :1], np.tile(middle / 0.05, (4, 1)), rtol=1e-3)


def test_the_same_seed_draws_the_same() -> None:
    """A band can be made again; another seed makes another, as wide within a tenth."""
    scene = Scene.from_mapping(LINEAR)
    first, again, other = (spread(scene, 2.0, seed=seed).of_displacement for seed in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
    widths = [np.mean(found[2] - found[1]) for found in (first, other)]
    assert widths[0] == pytest.approx(widths[1], rel=0.1)


def test_what_has_no_band_is_refused() -> None:
    """A mass that may be 0, and a run too long to draw, are one line each."""
    vague = Scene.from_mapping({**LINEAR, "bob": {"mass_kg": {"value": 0.2, "u": 0.1}}})
    with pytest.raises(DynamicsError, match="mass_kg"):
        spread(vague, 1.0)
    with pytest.raises(DynamicsError):
        spread(Scene.from_mapping(LINEAR), 1e5)
