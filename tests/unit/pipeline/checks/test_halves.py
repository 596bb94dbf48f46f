"""Two halves of a run under one model."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.checks.halves import difference


def _line(seed: int, bend: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Return residuals and slopes of points about a line, and chi-square of the difference of two separate lines."""
    t = np.linspace(0.0, 1.0, 60)
    y = 3.0 + 2.0 * t + bend * np.maximum(t - 0.5, 0.0) + np.random.default_rng(seed).standard_normal(t.size)
    design = np.stack([np.ones_like(t), t], axis=1)
    values = np.linalg.lstsq(design, y, rcond=None)[0]
    # Equal weights at even times: equal information is equal time.
    halves = [np.linalg.lstsq(design[part], y[part], rcond=None)[0] for part in (slice(30), slice(30, None))]
    covariance = sum(np.linalg.inv(design[part].T @ design[part]) for part in (slice(30), slice(30, None)))
    apart = halves[1] - halves[0]
    return y - design @ values, design, float(apart @ np.linalg.solve(covariance, apart))


@pytest.mark.parametrize("bend", [0.0, 20.0])
def test_chi_square_is_that_of_the_difference_of_separate_fits(bend: float) -> None:
    """For a linear model chi-square is that of the difference of the parameters of both halves, each fitted alone."""
    residual, slopes, expected = _line(1, bend)
    found = difference(residual, slopes, 1.0)
    assert found is not None
    assert found.parameters == 2
    assert found.chi2 == pytest.approx(expected, rel=1e-9)


def test_correlated_points_count_as_fewer_and_few_are_not_compared() -> None:
    """Chi-square is divided by the number of points that count as one, and each half needs those of a curve."""
    residual, slopes, expected = _line(2, 20.0)
    found = difference(residual, slopes, 3.0)
    assert found is not None
    assert found.chi2 == pytest.approx(expected / 3.0, rel=1e-9)
    assert difference(residual[:15], slopes[:15], 1.0) is None
