"""Laws are rejected where they fail, and named together where a record cannot distinguish them."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.analyse import Oscillation, analyse
from pipeline.damping.laws import LAWS
from pipeline.damping.select import Damping
from pipeline.track import Track
from tests.synthetic import LAW_TRUTHS, Truth, noisy, times


def damping_of(truth: Truth, seconds: float, sigma_m: float, seed: int = 1) -> Damping:
    """Return the laws of an analysed run."""
    t = times(seconds)
    motion = analyse(Track.from_arrays(t, noisy(truth, t, sigma_m, seed))).motion
    assert isinstance(motion, Oscillation)
    return motion.damping


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("name", ["none", "linear", "quadratic", "linear+quadratic"])
def test_the_true_law_is_admissible_and_simpler_ones_are_rejected(name: str, seed: int) -> None:
    """At 0.3 mm noise and two minutes the law that made the run is admitted and no law with fewer parameters."""
    found = damping_of(Truth(**LAW_TRUTHS.get(name, {})), 120.0, 3e-4, seed)
    assert name in found.admissible
    assert all(found.fits[n].rejected for n in LAWS if len(LAWS[n].parameters) < len(LAWS[name].parameters))
    if name in ("linear", "quadratic"):
        assert found.fits["quadratic" if name == "linear" else "linear"].rejected


@pytest.mark.parametrize("name", ["linear", "quadratic", "linear+quadratic"])
def test_coefficients_are_those_of_the_truth(name: str) -> None:
    """Every coefficient of the true law lies within four of its uncertainties."""
    joint = damping_of(Truth(**LAW_TRUTHS[name]), 120.0, 1e-4).fits[name].joint
    for coefficient, value in LAW_TRUTHS[name].items():
        assert abs(joint[coefficient].value - value) < 4.0 * joint[coefficient].u


def test_a_short_record_names_all_that_it_cannot_distinguish() -> None:
    """In ten seconds linear and quadratic drag are admissible together."""
    found = damping_of(Truth(gamma=0.003), 10.0, 3e-4)
    assert {"linear", "quadratic"} <= set(found.admissible)
    assert found.admissible[0] == found.selected


def test_an_exponential_growth_is_the_only_one_that_is_admitted() -> None:
    """A driven oscillation rejects every law of damping; its growth is stated as such."""
    found = damping_of(Truth(amplitude=0.01, gamma=-0.02), 60.0, 1e-4)
    assert found.admissible == ("linear",)
    assert found.growth_rate == pytest.approx(0.02, rel=0.01)
    assert damping_of(Truth(amplitude=0.05, gamma=0.02), 60.0, 1e-4).growth_rate == 0.0


def test_a_true_exponential_is_hardly_ever_rejected() -> None:
    """None of twenty, where one in a thousand should be."""
    truth = Truth(gamma=0.01463)
    assert not any(damping_of(truth, 30.0, 3e-4, seed).fits["linear"].rejected for seed in range(20))


def test_without_noise_the_fit_is_the_truth() -> None:
    """A perfect exponential has its rate to a part in a thousand, and is not rejected."""
    t = times(60.0)
    motion = analyse(Track.from_arrays(t, Truth(gamma=0.01).position(t))).motion
    assert isinstance(motion, Oscillation)
    assert motion.damping.fits["linear"].joint["gamma"].value == pytest.approx(0.01, rel=1e-3)
    assert np.isfinite(motion.damping.fits["linear"].reduced_chi2)
