"""A smooth curve is better than the mean where points follow one, and only there."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.numerics.regression import scatter, smooth_curve


def test_a_curve_that_points_follow_is_preferred() -> None:
    """Of a cubic in noise the curve errs by what so few coefficients let through, between the points too."""
    t = np.linspace(3.0, 9.0, 120)
    truth = np.polynomial.Polynomial([1.0, -0.3, 0.05, 0.02])
    y = truth(t) + 0.01 * np.random.default_rng(1).standard_normal(t.size)
    curve, gain = smooth_curve(t, y, scatter(t, y, np.full(t.size, 0.01)))
    assert gain > 10.0
    between = np.linspace(3.0, 9.0, 977).reshape(1, -1)
    assert curve(between).shape == between.shape
    np.testing.assert_allclose(curve(between), truth(between), atol=0.01)


def test_points_that_stay_prefer_their_mean() -> None:
    """Of 400 sets of white points at most one in a hundred prefers a curve by very strong evidence."""
    t, rng = np.arange(60.0), np.random.default_rng(2)
    sets = rng.standard_normal((400, t.size))
    gains = [smooth_curve(t, y, scatter(t, y, np.ones(t.size)))[1] for y in sets]
    assert np.count_nonzero(np.array(gains) > 10.0) <= 4


@pytest.mark.parametrize("size", [1, 2, 5, 7])
def test_few_points_have_a_mean_alone(size: int) -> None:
    """Fewer than eight give no curve; its value is their mean everywhere."""
    t, y = np.arange(float(size)), np.arange(float(size)) ** 2
    curve, gain = smooth_curve(t, y, scatter(t, y, np.ones(size)))
    assert gain == 0.0
    np.testing.assert_allclose(curve(np.array([-5.0, 0.5, 40.0])), y.mean())
