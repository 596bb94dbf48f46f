"""Weighted regression against scipy and numpy, correlation against its closed form."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal
import scipy.stats
from hypothesis import given
from hypothesis import strategies as st

from pipeline.numerics.regression import chi2_quantile, correlation_length, covariance_of, solve_weighted


@pytest.mark.parametrize("dof", [1, 2, 7.5, 100, 11_000])
@pytest.mark.parametrize("probability", [0.001, 0.5, 0.997])
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


def test_columns_of_unequal_size_do_no_harm() -> None:
    """Powers of a Unix time far apart in size are solved to the digits that they hold."""
    t = np.linspace(0.0, 1e5, 200)
    design = np.stack([np.ones(200), t, t**2, t**3], axis=1)
    truth = np.array([1.0, 1e-4, 1e-9, 1e-14])
    line = solve_weighted(design, design @ truth, np.full(200, 1e-3))
    np.testing.assert_allclose(line.values, truth, rtol=1e-6)


@pytest.mark.parametrize("units", [(1.0, 1.0, 1.0), (1e-9, 1.0, 1e12)])
def test_covariance_is_the_inverse_of_the_information(units: tuple[float, ...]) -> None:
    """In any units of the parameters; infinite where one depends on others, is absent or is no number."""
    jacobian = np.random.default_rng(3).normal(size=(30, 3)) * units
    expected = np.linalg.inv((jacobian / units).T @ (jacobian / units)) / np.outer(units, units)
    np.testing.assert_allclose(covariance_of(jacobian), expected, rtol=1e-10)
    for last in (jacobian[:, 0] * 2e7, np.zeros(30), np.full(30, np.nan), np.full(30, np.inf)):
        assert np.all(np.isinf(covariance_of(np.column_stack([jacobian[:, :2], last]))))
    assert np.all(np.isinf(covariance_of(jacobian[:2])))


@pytest.mark.parametrize("rho", [0.0, 0.5])
def test_correlation_length_of_an_autoregression(rho: float) -> None:
    """For AR(1) noise 1 + 2 sum rho^k is (1 + rho)/(1 - rho), found within a tenth on average."""
    lengths = []
    for seed in range(40):
        noise = np.random.default_rng(seed).standard_normal(4000)
        series = scipy.signal.lfilter([1.0], [1.0, -rho], noise)
        lengths.append(correlation_length(series))
    assert float(np.mean(lengths)) == pytest.approx((1.0 + rho) / (1.0 - rho), rel=0.1)


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=60))
def test_correlation_length_is_never_below_one(residual: list[float]) -> None:
    """Anticorrelated residuals do not make an uncertainty smaller than independent ones."""
    assert correlation_length(np.array(residual)) >= 1.0
