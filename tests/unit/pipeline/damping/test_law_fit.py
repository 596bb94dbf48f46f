"""What one fitted law says of its record: rates and their derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.damping.law_fit import LawFit, joint_of, rates_of
from pipeline.damping.laws import LAWS

VALUES = {"A0": 0.05, "mu": 2e-4, "gamma": 0.007, "beta": 0.2, "c": 0.03, "n": 1.4}


def parameters(name: str) -> np.ndarray:
    """Return plausible values of a law's parameters."""
    return np.array([VALUES[parameter] for parameter in LAWS[name].parameters])


@pytest.mark.parametrize("name", list(LAWS))
def test_the_rate_at_the_start_and_its_slopes(name: str) -> None:
    """The rate is minus the logarithmic slope of the amplitude at 0, its derivatives what central differences give."""
    law, theta = LAWS[name], parameters(name)

    def fitted(values: np.ndarray) -> LawFit:
        return LawFit(law, joint_of(law, values, 1e-10 * np.eye(values.size)), 1.0, 1.0, 1.0, True, "")

    early = np.array([0.0, 1e-4])
    first, second = law.curve(early, theta)[0]
    assert fitted(theta).rate_at_start() == pytest.approx((first - second) / (1e-4 * first), rel=1e-4, abs=1e-9)
    steps = np.diag(1e-5 * theta)
    rises = [fitted(theta + step).rate_at_start() - fitted(theta - step).rate_at_start() for step in steps]
    np.testing.assert_allclose(fitted(theta).slopes_of_rate(), np.array(rises) / (2e-5 * theta), rtol=1e-6, atol=1e-9)


def test_the_uncertainty_of_a_rate_is_that_of_its_coefficients() -> None:
    """Of linear and quadratic drag, whose rate is a sum, it is the sum's with the correlation of the two."""
    theta, covariance = np.array([0.05, 0.007, 0.2]), np.diag([1e-8, 4e-6, 1e-3])
    covariance[1, 2] = covariance[2, 1] = -4e-5
    amplitude = np.array([0.02, 0.05])
    rate, u = rates_of(LAWS["linear+quadratic"], amplitude, theta, covariance)
    np.testing.assert_allclose(rate, 0.007 * amplitude + 0.2 * amplitude**2, rtol=1e-12)
    variance = 4e-6 * amplitude**2 - 8e-5 * amplitude**3 + 1e-3 * amplitude**4
    np.testing.assert_allclose(u, np.sqrt(variance), rtol=1e-6)
