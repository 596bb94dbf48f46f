"""A smooth curve is fitted where points ask for it, and only there."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.numerics.smooth_curve import fit_curve


def test_a_curve_that_points_follow_is_found() -> None:
    """Of a cubic in noise the curve errs by what so few coefficients let through, between the points too."""
    t = np.linspace(3.0, 9.0, 120)
    truth = np.polynomial.Polynomial([1.0, -0.3, 0.05, 0.02])
    found = fit_curve(t, truth(t) + 0.01 * np.random.default_rng(1).standard_normal(t.size), np.full(t.size, 0.01))
    assert found.bends
    between = np.linspace(3.0, 9.0, 977).reshape(1, -1)
    assert found.at(between).shape == between.shape
    np.testing.assert_allclose(found.at(between), truth(between), atol=0.01)


def test_points_that_stay_ask_for_no_curve() -> None:
    """Of 400 sets of white points at most one in a hundred bends; the mean is theirs."""
    t, rng = np.arange(60.0), np.random.default_rng(2)
    found = [fit_curve(t, rng.standard_normal(t.size), np.ones(t.size)) for _ in range(400)]
    assert sum(each.bends for each in found) <= 4
    assert float(np.std([each.constant.values[0] for each in found])) == pytest.approx(1.0 / np.sqrt(60.0), rel=0.2)


@pytest.mark.parametrize("size", [1, 2, 5, 7])
def test_few_points_have_a_mean_alone(size: int) -> None:
    """Fewer than eight give no curve; its value is their mean everywhere."""
    t, y = np.arange(float(size)), np.arange(float(size)) ** 2
    found = fit_curve(t, y, np.ones(size))
    assert not found.bends
    np.testing.assert_allclose(found.at(np.array([-5.0, 0.5, 40.0])), y.mean())
