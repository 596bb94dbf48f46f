"""The band of a scene's uncertainties: against linear propagation, with correlations, with friction, and refused."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from pipeline.bench.scene import Scene
from pipeline.dynamics import Problem, effective_mass_kg, get_integrator
from pipeline.dynamics.band import MEMBERS, SHARES, draw, spread, uncertain
from pipeline.errors import DynamicsError
from pipeline.numerics.estimate import Joint

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


def each_of(ensemble: list[Problem], name: str) -> np.ndarray:
    """Return a coefficient of every member."""
    return np.array([getattr(one.equation, name) for one in ensemble])


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
    assert set(band.quantities) == {
        *("bob_mass_kg", "spring_mass_kg", "spring_constant_n_per_m", "gamma_per_s"),
        *("start_displacement_m", "start_velocity_m_per_s"),
    }


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


def test_what_was_measured_together_is_drawn_together() -> None:
    """A covariance is kept; a measured spring constant goes with the drawn masses, so that the frequency stays."""
    scene = Scene.from_mapping({**LINEAR, "bob": {"mass_kg": {"value": 0.2, "u": 0.002}}})
    covariance = np.array([[1e-8, -0.9e-7, 0.0], [-0.9e-7, 1e-6, 0.0], [0.0, 0.0, 1e-8]])
    names = ("gamma_per_s", "start_displacement_m", "spring_constant_n_per_m")
    measured = Joint(names, np.array([0.05, 0.05, 20.0]), covariance, ("1/s", "m", "N/m"))
    ensemble = draw(scene, measured, members=400)
    gamma = each_of(ensemble, "gamma_per_s")[1:]
    start = [one.displacement_m for one in ensemble[1:]]
    np.testing.assert_allclose(np.cov(gamma, start), covariance[:2, :2], rtol=0.15)
    omega = each_of(ensemble, "angular_frequency_per_s")
    assert omega[0] == pytest.approx(math.sqrt(20.0 / effective_mass_kg(scene)), rel=1e-12)
    assert np.std(omega[1:]) == pytest.approx(0.5 * omega[0] * 1e-4 / 20.0, rel=0.02)
    assert np.std(each_of(draw(scene), "angular_frequency_per_s")[1:]) > 0.004 * omega[0]


def test_friction_stops_every_member_within_its_band() -> None:
    """Each member is held where it stops; the band is then that of their resting places and no longer changes."""
    damping = {"mu_m_per_s": {"value": 0.02, "u": 5e-4}, "beta_per_m_s": 0.2}
    scene = Scene.from_mapping({**LINEAR, "damping": damping})
    band = spread(scene, 10.0)
    late = band.t > 6.0
    assert np.ptp(band.of_displacement[:, late], axis=1).max() == 0.0
    ensemble = draw(scene)
    assert len(ensemble) == MEMBERS + 1
    ends = [get_integrator("strang").run(one, 0.02, 500).y[-1] for one in ensemble]
    expected = np.quantile(ends[1:], SHARES, method="hazen") - ends[0]
    np.testing.assert_allclose(band.of_displacement[:, -1], expected, rtol=0, atol=2e-5)
    assert band.of_displacement[3, -1] > band.of_displacement[0, -1]


def test_a_long_band_is_one_motion() -> None:
    """Solved stretch by stretch, each member goes on where it was: as in one run."""
    scene = Scene.from_mapping(LINEAR | {"damping": {"beta_per_m_s": {"value": 0.2, "u": 0.01}}})
    band = spread(scene, 45.0 * 10.0, members=40, ensemble=True)
    strang = get_integrator("strang")
    ends = [strang.run(one, float(band.t[1]), band.t.size - 1).y[-1] for one in draw(scene, members=40)]
    expected = np.quantile(ends[1:], SHARES, method="hazen") - ends[0]
    np.testing.assert_allclose(band.of_displacement[:, -1], expected, rtol=1e-9, atol=1e-12)


def test_the_same_seed_draws_the_same() -> None:
    """A band can be made again; another seed makes another, as wide within a tenth."""
    scene = Scene.from_mapping(LINEAR)
    first, again, other = (spread(scene, 2.0, seed=seed).of_displacement for seed in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
    widths = [np.mean(found[2] - found[1]) for found in (first, other)]
    assert widths[0] == pytest.approx(widths[1], rel=0.1)


def test_only_what_moves_the_bob_is_uncertain() -> None:
    """Plain numbers, the sensor, and air that no disc moves make no band."""
    plain = {"bob": {"mass_kg": 0.2}, "spring": {"constant_n_per_m": 20.0}, "start": {"displacement_m": 0.05}}
    idle = {"air": {"temperature_c": {"value": 20.0, "u": 1.0}}, "sensor": {"sigma_m": {"value": 3e-4, "u": 1e-5}}}
    assert uncertain(Scene.from_mapping(plain | idle)).names == ()
    disc = {"disc": {"diameter_m": 0.102}}
    assert uncertain(Scene.from_mapping(plain | idle | disc)).names == ("air_temperature_c",)
    band = spread(Scene.from_mapping(plain | idle | disc), 1.0)
    assert 0.0 < np.max(band.of_displacement) < 1e-5


def test_what_has_no_band_is_refused() -> None:
    """A mass that may be 0, and a run too long to draw, are one line each."""
    vague = Scene.from_mapping({**LINEAR, "bob": {"mass_kg": {"value": 0.2, "u": 0.1}}})
    with pytest.raises(DynamicsError, match=r"the uncertainty of bob_mass_kg, .* reaches down to 0"):
        spread(vague, 1.0)
    with pytest.raises(DynamicsError, match=r"takes .* steps, more than 50000; ask for at most"):
        spread(Scene.from_mapping(LINEAR), 1e5)


def test_a_coefficient_is_never_drawn_below_zero() -> None:
    """Damping that may as well be none is drawn as none at least."""
    damping = {"gamma_per_s": {"value": 1e-3, "u": 5e-3}}
    gamma = each_of(draw(Scene.from_mapping({**LINEAR, "damping": damping})), "gamma_per_s")
    assert np.min(gamma) == 0.0
    assert np.mean(gamma == 0.0) == pytest.approx(0.42, abs=0.02)
    assert Problem.from_scene(Scene.from_mapping(LINEAR)).equation.gamma_per_s == 0.05
