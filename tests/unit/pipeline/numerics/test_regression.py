"""Weighted regression against scipy and numpy, correlation against its closed form, scatter against what was put in."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.signal
import scipy.stats
from hypothesis import given
from hypothesis import strategies as st

from pipeline.numerics.regression import chi2_quantile, correlation_length, covariance_of, scatter, solve_weighted


@pytest.mark.parametrize("dof", [1, 2, 3, 4, 5, 7.5, 10, 30, 100, 161.3, 1000, 11_000])
@pytest.mark.parametrize("probability", [0.001, 0.05, 0.5, 0.95, 0.99, 0.997, 0.999])
def test_chi2_quantile_is_that_of_the_distribution(probability: float, dof: float) -> None:
    """Of the distribution's values the stated share lies below the quantile, for any degrees of freedom."""
    assert chi2_quantile(probability, dof) == pytest.approx(scipy.stats.chi2.ppf(probability, dof), rel=1e-9)


def test_solution_is_numpys() -> None:
    """Values, covariance and chi-square are those of the weighted normal equations and of lstsq."""
    rng = np.random.default_rng(1)
    design, u = rng.normal(size=(40, 4)), rng.uniform(0.1, 3.0, 40)
    y = rng.normal(size=40)
    line = solve_weighted(design, y, u)
    values, chi2, *_ = np.linalg.lstsq(design / u[:, None], y / u, rcond=None)
    np.testing.assert_allclose(line.values, values, rtol=1e-10)
    assert line.chi2 == pytest.approx(float(chi2[0]), rel=1e-10)
    np.testing.assert_allclose(line.covariance, np.linalg.inv(design.T @ (design / u[:, None] ** 2)), rtol=1e-9)
    np.testing.assert_allclose(line.residual, y - design @ values, atol=1e-12)


def test_straight_line_is_scipys() -> None:
    """For equal weights slope and intercept are those of scipy's linear regression."""
    rng = np.random.default_rng(2)
    x = np.linspace(0.0, 9.0, 50)
    y = 2.0 - 0.3 * x + 0.1 * rng.standard_normal(50)
    line = solve_weighted(np.stack([np.ones(50), x], axis=1), y, np.full(50, 0.1))
    other = scipy.stats.linregress(x, y)
    np.testing.assert_allclose(line.values, [other.intercept, other.slope], rtol=1e-12)
    scale = math.sqrt(line.chi2 / 48) / 1.0
    assert math.sqrt(line.covariance[1, 1]) * scale == pytest.approx(other.stderr, rel=1e-10)


def test_columns_of_unequal_size_do_no_harm() -> None:
    """Powers of a Unix time far apart in size are solved to the digits that they hold."""
    t = np.linspace(0.0, 1e5, 200)
    design = np.stack([np.ones(200), t, t**2, t**3], axis=1)
    truth = np.array([1.0, 1e-4, 1e-9, 1e-14])
    line = solve_weighted(design, design @ truth, np.full(200, 1e-3))
    np.testing.assert_allclose(line.values, truth, rtol=1e-6)


def test_column_of_zeros_has_no_value() -> None:
    """A column that is nowhere anything yields 0 and keeps the others right."""
    design = np.stack([np.ones(10), np.zeros(10)], axis=1)
    np.testing.assert_allclose(solve_weighted(design, np.full(10, 3.0), np.ones(10)).values, [3.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("units", [(1.0, 1.0, 1.0), (1e-9, 1.0, 1e12)])
def test_covariance_is_the_inverse_of_the_information(units: tuple[float, ...]) -> None:
    """In any units of the parameters; infinite where one depends on others, is absent or is no number."""
    jacobian = np.random.default_rng(3).normal(size=(30, 3)) * units
    expected = np.linalg.inv((jacobian / units).T @ (jacobian / units)) / np.outer(units, units)
    np.testing.assert_allclose(covariance_of(jacobian), expected, rtol=1e-10)
    for last in (jacobian[:, 0] * 2e7, np.zeros(30), np.full(30, np.nan), np.full(30, np.inf)):
        assert np.all(np.isinf(covariance_of(np.column_stack([jacobian[:, :2], last]))))
    assert np.all(np.isinf(covariance_of(jacobian[:2])))


@pytest.mark.parametrize("rho", [0.0, 0.3, 0.5, 0.7])
def test_correlation_length_of_an_autoregression(rho: float) -> None:
    """For AR(1) noise 1 + 2 sum rho^k is (1 + rho)/(1 - rho), found within a tenth on average."""
    lengths = []
    for seed in range(40):
        noise = np.random.default_rng(seed).standard_normal(4000)
        series = scipy.signal.lfilter([1.0], [1.0, -rho], noise)
        lengths.append(correlation_length(series))
    assert float(np.mean(lengths)) == pytest.approx((1.0 + rho) / (1.0 - rho), rel=0.1)


@pytest.mark.parametrize("residual", [np.zeros(50), np.full(50, 3.0), np.arange(7.0), np.array([1.0])])
def test_correlation_length_of_nothing_is_one(residual: np.ndarray) -> None:
    """Constant residuals and fewer than eight points count each for itself."""
    assert correlation_length(residual) == 1.0


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=60))
def test_correlation_length_is_never_below_one(residual: list[float]) -> None:
    """Anticorrelated residuals do not make an uncertainty smaller than independent ones."""
    assert correlation_length(np.array(residual)) >= 1.0


def curve(t: np.ndarray) -> np.ndarray:
    """Return a smooth decay."""
    return np.exp(-t / 60.0)


def test_white_scatter_is_no_excess() -> None:
    """Points that scatter as stated get no excess in nineteen of twenty records and lose no point."""
    t, u = np.arange(100.0), np.full(100, 0.01)
    found = [scatter(t, curve(t) + np.random.default_rng(s).normal(0, 0.01, 100), u) for s in range(60)]
    assert np.mean([f.excess == 0.0 for f in found]) >= 0.95
    assert np.mean([f.correlation for f in found]) < 1.25
    assert sum(np.count_nonzero(~f.kept) for f in found) <= 2


def test_excess_is_found() -> None:
    """Scatter of 0.03 beyond a noise of 0.01 is measured as such and added in quadrature."""
    t, u = np.arange(100.0), np.full(100, 0.01)
    excess = [
        scatter(t, curve(t) + np.random.default_rng(s).normal(0, math.hypot(0.01, 0.03), 100), u).excess
        for s in range(60)
    ]
    assert float(np.median(excess)) == pytest.approx(0.03, rel=0.1)


def test_single_outlier_is_left_out() -> None:
    """One point twenty standard uncertainties off is not kept and makes no excess."""
    t, u = np.arange(60.0), np.full(60, 0.01)
    y = curve(t) + np.random.default_rng(3).normal(0, 0.01, 60)
    y[30] += 0.2
    found = scatter(t, y, u)
    assert np.flatnonzero(~found.kept).tolist() == [30]
    assert found.excess == 0.0


@pytest.mark.parametrize("count", [1, 2, 3, 5, 7])
def test_too_few_points_measure_nothing(count: int) -> None:
    """Under eight points the stated uncertainties stand and every point is kept."""
    found = scatter(np.arange(float(count)), np.ones(count), np.full(count, 0.1))
    assert found.excess == 0.0
    assert found.kept.all()
    np.testing.assert_array_equal(found.u, np.full(count, 0.1))
