"""Laws are fitted with the covariance that points have, rejected where they fail, and named together where all do."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import numpy as np
import pytest

from pipeline.damping.laws import LAWS
from pipeline.damping.select import Damping, Params, fit_damping
from pipeline.windows.demodulate import Demodulated

Windows = Callable[..., Demodulated]
T = 0.4 + 0.757 * np.arange(158)  # two minutes


def fitted(windows: Windows, amplitude: np.ndarray, u_m: float, t: np.ndarray = T, **options: object) -> Damping:
    """Return the laws' fits to amplitudes of a run that begins at t = 0."""
    return fit_damping(windows(t, amplitude, u=(u_m, 1e-4, 1e-5)), 0.0, Params(**options))  # type: ignore[arg-type]


def noisy(amplitude: np.ndarray, u_m: float, seed: int) -> np.ndarray:
    """Return amplitudes with independent normal errors."""
    return amplitude + np.random.default_rng(seed).normal(0.0, u_m, amplitude.size)


MIXED = {"gamma": 0.0073, "beta": 0.235}


def test_every_law_is_tried(windows: Windows) -> None:
    """Each law of the registry has its fit, under its name, or a reason why it has none."""
    found = fitted(windows, noisy(np.full(T.size, 0.05), 1e-5, 1), 1e-5)
    assert set(found.fits) | set(found.unfitted) == set(LAWS)
    assert set(found.unfitted) <= {"power"}
    damped = fitted(windows, noisy(0.05 * np.exp(-0.01 * T), 1e-5, 1), 1e-5)
    assert set(damped.fits) == set(LAWS)
    assert all(found.fits[name].name == name for name in found.fits)


def test_only_the_laws_asked_for_are_tried(windows: Windows) -> None:
    """The options restrict the laws."""
    assert set(fitted(windows, np.full(T.size, 0.05), 1e-5, laws=("linear",)).fits) == {"linear"}


@pytest.mark.parametrize(
    ("name", "coefficients"),
    [
        ("none", {}),
        ("linear", {"gamma": 0.01463}),
        ("quadratic", {"beta": 0.4}),
        ("linear+quadratic", MIXED),
    ],
)
def test_true_law_is_admissible_and_false_ones_rejected(
    synthetic: ModuleType, windows: Windows, name: str, coefficients: dict[str, float]
) -> None:
    """At 0.3 mm noise and two minutes the law that made the run is admitted and no simpler one, in every of 20 runs."""
    truth = synthetic.Truth(**coefficients)
    clean = truth.amplitude_at(T)
    for seed in range(20):
        found = fitted(windows, noisy(clean, 5e-5, seed), 5e-5)
        assert name in found.admissible
        simpler = [n for n in LAWS if len(LAWS[n].parameters) < len(LAWS[name].parameters)]
        assert all(found.fits[n].rejected for n in simpler)
        if len(coefficients) == 1:
            other = "quadratic" if name == "linear" else "linear"
            assert found.fits[other].rejected
            assert found.fits[other].reduced_chi2 > 10.0


@pytest.mark.parametrize("u_m", [5e-5, 4e-4])
def test_intervals_hold(synthetic: ModuleType, windows: Windows, u_m: float) -> None:
    """Over 300 runs of mixed drag each coefficient's 68 and 95 % interval covers the truth so often."""
    truth = synthetic.Truth(**MIXED)
    clean = truth.amplitude_at(T)
    z = []
    for seed in range(300):
        joint = fitted(windows, noisy(clean, u_m, seed), u_m, laws=("linear+quadratic",)).fits["linear+quadratic"].joint
        z.append(
            [
                (joint[n].value - v) / joint[n].u
                for n, v in (("A0", truth.amplitude), ("gamma", truth.gamma), ("beta", truth.beta))
            ]
        )
    pulls = np.abs(np.array(z))
    np.testing.assert_allclose(np.mean(pulls <= 1.0, axis=0), 0.683, atol=0.09)
    np.testing.assert_allclose(np.mean(pulls <= 1.96, axis=0), 0.95, atol=0.04)


def test_true_law_is_hardly_ever_rejected(synthetic: ModuleType, windows: Windows) -> None:
    """At most one in a hundred true exponentials is rejected where one in a thousand should."""
    clean = synthetic.Truth(gamma=0.01463).amplitude_at(T)
    rejected = sum(fitted(windows, noisy(clean, 1e-4, s), 1e-4).fits["linear"].rejected for s in range(300))
    assert rejected <= 3


def test_short_record_names_all_it_cannot_tell_apart(synthetic: ModuleType, windows: Windows) -> None:
    """In ten seconds linear, quadratic and mixed drag are admissible together."""
    t = T[:13]
    clean = synthetic.Truth(gamma=0.003).amplitude_at(t)
    found = fitted(windows, noisy(clean, 5e-5, 1), 5e-5, t)
    assert set(found.admissible) >= {"linear", "quadratic"}
    assert found.admissible[0] == found.selected


def test_excess_scatter_widens_and_does_not_hide_a_wrong_law(synthetic: ModuleType, windows: Windows) -> None:
    """Beats of 0.5 mm on amplitudes known to 0.01 mm widen the intervals; the exponential stays rejected."""
    clean = synthetic.Truth(**MIXED).amplitude_at(T)
    z = []
    for seed in range(30):
        found = fitted(windows, noisy(clean, 5e-4, seed), 1e-5)
        assert found.scatter.excess == pytest.approx(5e-4, rel=0.35)
        assert found.fits["linear"].rejected
        assert not found.fits["linear+quadratic"].rejected
        z.append(
            (found.fits["linear+quadratic"].joint["beta"].value - 0.235)
            / found.fits["linear+quadratic"].joint["beta"].u
        )
    assert np.std(z) < 1.4


def test_lone_wrong_amplitude_is_left_out(synthetic: ModuleType, windows: Windows) -> None:
    """One window that lost its way moves no coefficient."""
    amplitude = noisy(synthetic.Truth(gamma=0.01463).amplitude_at(T), 5e-5, 2)
    right = fitted(windows, amplitude, 5e-5).fits["linear"].joint["gamma"]
    amplitude[70] *= 2.0
    wrong = fitted(windows, amplitude, 5e-5).fits["linear"].joint["gamma"]
    assert abs(wrong.value - right.value) < 0.3 * right.u


@pytest.mark.parametrize(
    ("count", "laws"),
    [
        (1, {"none"}),
        (2, {"none", "linear", "quadratic", "friction"}),
        (3, set(LAWS) - {"linear+quadratic+friction", "power"}),
        (4, set(LAWS) - {"power"}),
    ],
)
def test_few_windows_allow_few_laws(windows: Windows, count: int, laws: set[str]) -> None:
    """A law needs as many windows as it has parameters, and where it just has them it is fitted through them."""
    found = fitted(windows, 0.05 * np.exp(-0.01 * T[:count]), 1e-5, T[:count])
    assert set(found.fits) - {"power"} == laws
    assert set(found.unfitted) - {"power"} == set(LAWS) - laws - {"power"}
    assert found.selected in found.fits


def test_growing_amplitude_is_no_damping(windows: Windows) -> None:
    """A driven oscillation gives negative coefficients and rejects every law of damping."""
    found = fitted(windows, 0.02 * np.exp(0.01 * T), 1e-5)
    assert all(fit.rejected for fit in found.fits.values())
    assert found.admissible == ()
    assert found.selected in found.fits


def test_rate_at_the_start(synthetic: ModuleType, windows: Windows) -> None:
    """The logarithmic rate is gamma + beta A0, its uncertainty that of 400 runs."""
    truth = synthetic.Truth(**MIXED)
    clean = truth.amplitude_at(T)
    rates = [
        fitted(windows, noisy(clean, 1e-4, s), 1e-4, laws=("linear+quadratic",)).best.damping_rate() for s in range(200)
    ]
    expected = truth.gamma + truth.beta * truth.amplitude
    assert np.mean([r.value for r in rates]) == pytest.approx(expected, rel=2e-3)
    assert np.std([r.value for r in rates]) == pytest.approx(np.mean([r.u for r in rates]), rel=0.15)
    assert rates[0].unit == "1/s"


def test_uncertainty_of_the_curve(synthetic: ModuleType, windows: Windows) -> None:
    """The band about the fitted amplitude is as wide as fits scatter, at the start as at the end."""
    clean = synthetic.Truth(**MIXED).amplitude_at(T)
    at = np.array([0.0, 30.0, 120.0])
    fits = [fitted(windows, noisy(clean, 1e-4, s), 1e-4).fits["linear+quadratic"] for s in range(200)]
    spread = np.std([f.amplitude(at) for f in fits], axis=0)
    np.testing.assert_allclose(fits[0].u_amplitude(at), spread, rtol=0.2)


def test_perfect_points_are_no_division_by_nothing(synthetic: ModuleType, windows: Windows) -> None:
    """Amplitudes without any error and without uncertainty are fitted to the truth."""
    found = fitted(windows, synthetic.Truth(gamma=0.01).amplitude_at(T), 0.0)
    assert found.fits["linear"].joint["gamma"].value == pytest.approx(0.01, rel=1e-9)
    assert not found.fits["linear"].rejected
