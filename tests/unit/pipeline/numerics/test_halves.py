"""Two halves of a run under one model."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.numerics.halves import Points, difference


def _line(seed: int, bend: float) -> tuple[Points, float]:
    """Return points about a straight line with unit noise, and chi-square of the difference of two separate lines."""
    t = np.linspace(0.0, 1.0, 60)
    y = 3.0 + 2.0 * t + bend * np.maximum(t - 0.5, 0.0) + np.random.default_rng(seed).standard_normal(t.size)
    design = np.stack([np.ones_like(t), t], axis=1)
    values = np.linalg.lstsq(design, y, rcond=None)[0]
    # Equal weights at even times: equal information is equal time.
    halves = [np.linalg.lstsq(design[part], y[part], rcond=None)[0] for part in (slice(30), slice(30, None))]
    covariance = sum(np.linalg.inv(design[part].T @ design[part]) for part in (slice(30), slice(30, None)))
    apart = halves[1] - halves[0]
    return Points(y - design @ values, design, 1.0), float(apart @ np.linalg.solve(covariance, apart))


@pytest.mark.parametrize("bend", [0.0, 20.0])
def test_chi_square_is_that_of_the_difference_of_separate_fits(bend: float) -> None:
    """For a linear model chi-square is that of the difference of the parameters of both halves, each fitted alone."""
    points, expected = _line(1, bend)
    found = difference(points, 8)
    assert found is not None
    assert found.parameters == 2
    assert found.chi2 == pytest.approx(expected, rel=1e-9)


def test_correlated_points_count_as_fewer_and_few_are_not_compared() -> None:
    """Chi-square is divided by the number of points that count as one, and a half needs the fewest points asked for."""
    points, expected = _line(2, 20.0)
    found = difference(Points(points.residual, points.slopes, 3.0), 8)
    assert found is not None
    assert found.chi2 == pytest.approx(expected / 3.0, rel=1e-9)
    assert difference(points, 31) is None
