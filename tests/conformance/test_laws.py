"""Every damping law obeys its equation, its Jacobian its amplitude, its guess its points; a law takes part by name."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pipeline import damping
from pipeline.demodulate import Demodulated
from pipeline.laws import LAWS, Law

# Rows of coefficients; a law takes those that its parameters name.
BENCHES = (
    {"A0": 0.051, "gamma": 0.0073, "beta": 0.235},
    {"A0": 0.002, "gamma": 0.05, "beta": 3.0},
    {"A0": 0.3, "gamma": 1e-9, "beta": 1e-9},
    {"A0": 0.051, "gamma": 8.3e-6, "beta": 0.235},  # gamma t lies on either side of the series' border
    {"A0": 0.051, "gamma": 0.0, "beta": 0.0},
    {"A0": 0.051, "gamma": -0.002, "beta": 0.1},  # a fit may step through negative coefficients
)
FADING = BENCHES[:2]
T = np.linspace(0.0, 120.0, 241)
SIZES = [0.0, *(10.0**power for power in (-300, -200, -100, -20, -12, -8, -6, -5, -4, -3, -2, -1, 0, 1, 2, 3))]


@pytest.fixture(params=sorted(LAWS))
def law(request: pytest.FixtureRequest) -> Law:
    """Return one law after the other."""
    return LAWS[request.param]


def theta_of(law: Law, bench: dict[str, float]) -> np.ndarray:
    """Return the law's parameters at a bench."""
    return np.array([bench[name] for name in law.parameters])


def test_name_is_key_and_amplitude_comes_first(law: Law) -> None:
    """A law is found under its own name, has a unit for each parameter and the amplitude in front."""
    assert LAWS[law.name] is law
    assert len(law.parameters) == len(law.units) == len(set(law.parameters))
    assert (law.parameters[0], law.units[0]) == ("A0", "m")


@pytest.mark.parametrize("bench", BENCHES)
def test_amplitude_solves_its_differential_equation(law: Law, bench: dict[str, float]) -> None:
    """The closed form is what an integrator makes of dA/dt = -rate(A)."""
    theta = theta_of(law, bench)
    solved = solve_ivp(lambda _, a: -law.rate(a, theta), (0.0, 120.0), theta[:1], "DOP853", T, rtol=1e-12, atol=1e-18)
    np.testing.assert_allclose(law.amplitude(T, theta), solved.y[0], rtol=1e-9)


@pytest.mark.parametrize("bench", BENCHES)
def test_jacobian_is_the_derivative(law: Law, bench: dict[str, float]) -> None:
    """Each column equals the central difference, extrapolated once, of the amplitude."""
    theta = theta_of(law, bench)
    jacobian = law.jacobian(T, theta)
    assert jacobian.shape == (T.size, theta.size)
    scales = {"A0": theta[0], "gamma": 0.01, "beta": 0.2}
    for k, name in enumerate(law.parameters):

        def difference(step: float, k: int = k) -> np.ndarray:
            shift = np.zeros_like(theta)
            shift[k] = step
            return (law.amplitude(T, theta + shift) - law.amplitude(T, theta - shift)) / (2.0 * step)

        step = 1e-3 * scales.get(name, max(abs(theta[k]), 1e-3))
        expected = (4.0 * difference(0.5 * step) - difference(step)) / 3.0
        np.testing.assert_allclose(jacobian[:, k], expected, atol=1e-7 * np.abs(expected).max(), rtol=1e-6)


@pytest.mark.parametrize("bench", FADING)
@pytest.mark.parametrize("count", [8, 40, 160])
def test_guess_leads_the_fit_to_the_truth(
    law: Law, bench: dict[str, float], count: int, windows: Callable[..., Demodulated]
) -> None:
    """From the law's own guess the fit reaches the coefficients that made clean points."""
    theta = theta_of(law, bench)
    t = 0.4 + 0.75 * np.arange(count)
    points = windows(t, law.amplitude(t, theta), u=(1e-7 * theta[0], 1e-4, 1e-5))
    fit = damping.fit_damping(points, 0.0, damping.Params(laws=(law.name,))).fits[law.name]
    assert fit.converged
    assert not fit.rejected
    np.testing.assert_allclose(law.amplitude(t, fit.joint.values), law.amplitude(t, theta), rtol=1e-8)
    u = np.sqrt(np.diag(fit.joint.covariance))
    assert np.all(np.abs(fit.joint.values - theta) <= 0.2 * u + 1e-12 * np.abs(theta))


def test_guess_survives_noise_and_lost_points(law: Law) -> None:
    """Points at the floor of the noise, one point, and equal points give finite start values."""
    rng = np.random.default_rng(5)
    for amplitude in (np.abs(rng.normal(0.0, 1e-3, 30)), np.full(30, 0.05), np.full(1, 0.05)):
        start = law.guess(0.75 * np.arange(amplitude.size), amplitude)
        assert start.shape == (len(law.parameters),)
        assert np.all(np.isfinite(start))


@pytest.mark.parametrize("size", SIZES)
def test_every_size_of_coefficient_is_finite(law: Law, size: float) -> None:
    """From nothing over 1e-300 to 1e3 amplitude, Jacobian and rate are finite, and no warning is raised."""
    for name in law.parameters[1:]:
        for other in (0.0, 0.1):
            theta = theta_of(law, {"A0": 0.05, "gamma": other, "beta": other} | {name: size})
            assert np.all(np.isfinite(law.amplitude(T, theta)))
            assert np.all(np.isfinite(law.jacobian(T, theta)))
            assert np.all(np.isfinite(law.rate(law.amplitude(T, theta), theta)))


@pytest.mark.parametrize("size", [1e-300, 1e-100, 1e-20, 1e-12])
def test_vanishing_coefficient_is_none(law: Law, size: float) -> None:
    """Amplitude and Jacobian go over into those of a coefficient that is exactly 0."""
    for name in law.parameters[1:]:
        bench = {"A0": 0.05, "gamma": 0.01, "beta": 0.2}
        small, zero = theta_of(law, bench | {name: size}), theta_of(law, bench | {name: 0.0})
        np.testing.assert_allclose(law.amplitude(T, small), law.amplitude(T, zero), rtol=2e-10)
        np.testing.assert_allclose(law.jacobian(T, small), law.jacobian(T, zero), rtol=2e-10, atol=1e-12)


@pytest.mark.parametrize("bench", BENCHES)
def test_starts_at_a0(law: Law, bench: dict[str, float]) -> None:
    """At t = 0 the amplitude is A0 and depends on nothing else."""
    theta = theta_of(law, bench)
    start = np.zeros(1)
    assert law.amplitude(start, theta)[0] == theta[0]
    np.testing.assert_allclose(law.jacobian(start, theta)[0], np.eye(theta.size)[0], atol=1e-12)


@pytest.mark.parametrize("bench", BENCHES[:4])
def test_positive_coefficients_never_raise_the_amplitude(law: Law, bench: dict[str, float]) -> None:
    """The amplitude stays positive and does not grow where every coefficient is positive or 0."""
    amplitude = law.amplitude(T, theta_of(law, bench))
    assert np.all(np.diff(amplitude) <= 1e-17)
    assert np.all(amplitude > 0)


def test_rate_keeps_the_shape(law: Law) -> None:
    """The rate is elementwise."""
    amplitudes = np.array([0.0, 0.01, 0.05])
    assert law.rate(amplitudes, theta_of(law, BENCHES[0])).shape == amplitudes.shape
    assert law.rate(amplitudes, theta_of(law, BENCHES[0]))[0] == 0.0
