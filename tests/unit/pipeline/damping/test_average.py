"""Averages over laws: what the record knows takes over from what is known of drag beforehand."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import ModuleType

import numpy as np
import pytest

from pipeline.damping.average import SPREAD_OF_POWER, Weighted, average_over_laws, spread_counts
from pipeline.damping.law_fit import LawFit
from pipeline.damping.select import Damping, Params, fit_damping
from pipeline.windows.demodulate import Demodulated

Windows = Callable[..., Demodulated]
START = 0.05


def fitted(windows: Windows, amplitude: np.ndarray, t: np.ndarray, noise_m: float, params: Params) -> Damping:
    """Return the damping of windows at t with that amplitude and noise."""
    noisy = amplitude + noise_m * np.random.default_rng(3).standard_normal(t.size)
    return fit_damping(windows(t, noisy, u=(noise_m, 1e-3, 1e-4)), 0.0, params)


def scale(fit: LawFit) -> float:
    """Return the factor on the covariance of a law that leaves more than its points' noise."""
    return max(fit.reduced_chi2, 1.0)


def of_truth(
    synthetic: ModuleType, windows: Windows, name: str, periods: int, noise_m: float, params: Params | None = None
) -> tuple[Damping, tuple[Weighted, ...], float]:
    """Return the damping of a law's windows, the average over laws and the mean amplitude."""
    t = 0.4 + 0.757 * np.arange(periods)
    amplitude = synthetic.Truth(**synthetic.LAW_TRUTHS[name]).amplitude_at(t)
    damping = fitted(windows, amplitude, t, noise_m, params or Params())
    size = float(np.mean(amplitude))
    return damping, average_over_laws(damping, size), size


def test_a_record_that_knows_no_curvature_has_the_exponential_and_a_range(
    synthetic: ModuleType, windows: Windows
) -> None:
    """Of ten noisy periods gamma and A0 are the exponential's, and beta is nothing by 1.4 gamma over the amplitude."""
    damping, weighted, size = of_truth(synthetic, windows, "linear", 10, 5e-4)
    linear, stated = damping.fits["linear"].joint, weighted[0].fit
    gamma = linear["gamma"]
    tau = SPREAD_OF_POWER * np.hypot(gamma.value, gamma.u) / size
    assert stated.name == "linear+quadratic"
    assert damping.fits["linear+quadratic"].joint["beta"].u > 4.0 * tau
    assert stated.joint["beta"].u == pytest.approx(math.sqrt(scale(stated)) * tau, rel=0.05)
    assert abs(stated.joint["beta"].value) < tau
    assert stated.joint["A0"].value == pytest.approx(linear["A0"].value, abs=0.2 * linear["A0"].u)
    assert stated.damping_rate().u < 0.5 * damping.fits["linear+quadratic"].damping_rate().u
    assert weighted[0].weight > 0.95  # which other law it is, nothing tells


def test_a_record_that_knows_its_curvature_has_the_fit(synthetic: ModuleType, windows: Windows) -> None:
    """Of 160 quiet periods parameters and covariance are those of linear and quadratic drag to a hundredth of u."""
    damping, weighted, _ = of_truth(synthetic, windows, "quadratic", 160, 2e-5)
    free, stated = damping.fits["linear+quadratic"].joint, weighted[0].fit.joint
    assert damping.selected == "quadratic"
    u = np.sqrt(np.diag(free.covariance))
    assert np.all(np.abs(stated.values - free.values) < 0.01 * u)
    factor = scale(damping.fits["linear+quadratic"])
    np.testing.assert_allclose(stated.covariance, factor * free.covariance, rtol=0.01)


def test_the_prior_is_that_of_one_more_measurement(synthetic: ModuleType, windows: Windows) -> None:
    """To first order the result is the weighted mean of the free fit and of beta = 0 +- tau."""
    damping, weighted, size = of_truth(synthetic, windows, "linear+quadratic", 25, 3e-4)
    free, gamma = damping.fits["linear+quadratic"].joint, damping.fits["linear"].joint["gamma"]
    tau = SPREAD_OF_POWER * np.hypot(gamma.value, gamma.u) / size
    gain = free.covariance[:, 2] / (free.covariance[2, 2] + tau**2)
    stated = weighted[0].fit.joint
    u = np.sqrt(np.diag(stated.covariance))
    assert np.all(np.abs(stated.values - (free.values - gain * free.values[2])) < 0.05 * u)
    expected = scale(damping.fits["linear+quadratic"]) * (free.covariance - np.outer(gain, free.covariance[2]))
    np.testing.assert_allclose(stated.covariance, expected, rtol=0.05, atol=0.0)


def evidence(damping: Damping) -> float:
    """Return what a record says for a power, which counts more where its rate lies near that of both drags."""
    power, mixed = damping.fits["power"], damping.fits["linear+quadratic"]
    rate = mixed.damping_rate()
    apart = (power.rate_at_start() - rate.value) / (5.0 * rate.u)
    return float(np.exp(-0.5 * (1.0 + 1.0 / (1.0 + apart**4)) * (power.bic - mixed.bic)))


def test_other_laws_weigh_by_their_evidence_and_by_what_the_record_knows(
    synthetic: ModuleType, windows: Windows
) -> None:
    """A power beside linear and quadratic drag has w exp(-s dBIC/2) of its weight; all add up to one."""
    damping, weighted, _ = of_truth(synthetic, windows, "linear+quadratic", 40, 1e-4)
    assert {"power", "linear+quadratic"} <= set(damping.admissible)
    by_name = {one.fit.name: one.weight for one in weighted}
    assert sum(by_name.values()) == pytest.approx(1.0)
    assert not {"none", "linear", "quadratic"} & set(by_name)
    assert by_name["power"] / by_name["linear+quadratic"] == pytest.approx(evidence(damping), rel=0.1)


@pytest.mark.parametrize("name", ["friction", "power", "linear+friction"])
def test_a_law_out_of_reach_of_both_drags_speaks_for_itself(synthetic: ModuleType, windows: Windows, name: str) -> None:
    """Where linear and quadratic drag does not fit the selected law comes first with the parameters of its fit."""
    damping, weighted, _ = of_truth(synthetic, windows, name, 160, 2e-5)
    assert damping.selected == name
    stated, best = weighted[0].fit.joint, damping.best
    assert weighted[0].fit.name == name
    np.testing.assert_array_equal(stated.values, best.joint.values)
    np.testing.assert_allclose(stated.covariance, scale(best) * best.joint.covariance)
    assert "linear+quadratic" not in {one.fit.name for one in weighted}


def test_few_laws_leave_what_they_are(synthetic: ModuleType, windows: Windows) -> None:
    """Without linear and quadratic drag among the laws tried the admissible ones are weighed by their BIC alone."""
    laws = Params(laws=("linear", "quadratic"))
    damping, weighted, _ = of_truth(synthetic, windows, "linear", 10, 1e-3, laws)
    assert len(damping.admissible) == 2
    assert [one.fit.name for one in weighted] == list(damping.admissible)
    best, other = (damping.fits[name].bic for name in damping.admissible)
    assert weighted[1].weight / weighted[0].weight == pytest.approx(np.exp(0.5 * (best - other)))


def test_mixed_drag_without_the_exponential_is_its_own_fit(synthetic: ModuleType, windows: Windows) -> None:
    """Where no exponential was fitted nothing is known beforehand."""
    damping, weighted, _ = of_truth(
        synthetic, windows, "linear+quadratic", 100, 1e-4, Params(laws=("linear+quadratic",))
    )
    assert len(weighted) == 1
    np.testing.assert_array_equal(weighted[0].fit.joint.values, damping.best.joint.values)
    np.testing.assert_allclose(weighted[0].fit.joint.covariance, scale(damping.best) * damping.best.joint.covariance)


def test_a_law_that_is_no_longer_admissible_still_weighs(synthetic: ModuleType, windows: Windows) -> None:
    """Between a power and both drags the one beyond reach of the evidence has its small weight, and u holds it."""
    t = 0.4 + 0.757 * np.arange(80)
    noise_m = 4.8e-5
    for seed in range(40):
        amplitude = synthetic.Truth(c=0.05, n=1.5, beta=0.2).amplitude_at(t)
        noisy = amplitude + noise_m * np.random.default_rng(seed).standard_normal(t.size)
        damping = fit_damping(windows(t, noisy, u=(noise_m, 1e-3, 1e-4)), 0.0)
        if damping.admissible == ("linear+quadratic",) and not damping.fits["power"].rejected:
            break
    weighted = average_over_laws(damping, float(np.mean(amplitude)))
    by_name = {one.fit.name: one.weight for one in weighted}
    assert by_name["power"] / by_name["linear+quadratic"] == pytest.approx(evidence(damping), rel=0.1)


def test_a_power_below_linear_drag_hardly_weighs_beside_friction(synthetic: ModuleType, windows: Windows) -> None:
    """Of linear drag with friction a power of 0.6 fits as well, and has 0.03 of the weight that its evidence gives."""
    damping, weighted, _ = of_truth(synthetic, windows, "linear+friction", 60, 1e-4)
    power, drag = damping.fits["power"], damping.fits["linear+friction"]
    assert {"power", "linear+friction"} <= set(damping.admissible)
    assert power.joint["n"].value < 1.0 - 5.0 * power.joint["n"].u
    by_name = {one.fit.name: one.weight for one in weighted}
    expected = 0.03 * math.exp(-0.5 * (power.bic - drag.bic))
    assert by_name["power"] / by_name["linear+friction"] == pytest.approx(expected)


def test_the_spread_of_laws_that_nearly_agree_counts_hardly_anything() -> None:
    """Of two laws whose variance is a hundredth of each variance it counts by 5e-10, of those that agree by nothing."""
    half = np.array([0.5, 0.5])
    assert spread_counts(half, np.array([1.0, 1.2]), np.ones(2)) == pytest.approx(5e-10)
    assert spread_counts(half, np.array([1.0, 1.0]), np.zeros(2)) == 0.0


def test_the_spread_of_laws_far_apart_counts_five_times() -> None:
    """Of two laws twenty u apart it counts by 5, in any unit, and where neither has an uncertainty."""
    weights, rates = np.array([0.25, 0.75]), np.array([1.0, 21.0])
    assert spread_counts(weights, rates, np.ones(2)) == 5.0
    assert spread_counts(weights, 1e-6 * rates, np.full(2, 1e-12)) == 5.0
    assert spread_counts(weights, rates, np.zeros(2)) == 5.0


def test_the_spread_counts_by_its_ratio_to_what_laws_say_of_themselves() -> None:
    """Where it is half of the mean own variance it counts by 5/32."""
    rates = np.array([1.0, 1.0 + math.sqrt(2.0)])
    assert spread_counts(np.array([0.5, 0.5]), rates, np.ones(2)) == pytest.approx(5.0 / 32.0)
