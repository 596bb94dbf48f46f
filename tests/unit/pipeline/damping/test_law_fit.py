"""What one fitted law says of its record: rates and their derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.damping.law_fit import LawFit
from pipeline.damping.laws import LAWS
from pipeline.numerics.estimate import Joint

VALUES = {"A0": 0.05, "mu": 2e-4, "gamma": 0.007, "beta": 0.2, "c": 0.03, "n": 1.4}


def parameters(name: str) -> np.ndarray:
    """Return plausible values of a law's parameters."""
    return np.array([VALUES[parameter] for parameter in LAWS[name].parameters])


@pytest.mark.parametrize("name", list(LAWS))
def test_the_rate_at_the_start_and_its_slopes(name: str) -> None:
    """The rate is minus the logarithmic slope of the amplitude at 0, its derivatives what central differences give."""
    law, theta = LAWS[name], parameters(name)

    def fitted(values: np.ndarray) -> LawFit:
        joint = Joint(law.parameters, values, 1e-10 * np.eye(values.size), law.units)
        return LawFit(law, joint, 1.0, 1.0, 1.0, True, "")

    early = np.array([0.0, 1e-4])
    first, second = law.amplitude(early, theta)
    assert fitted(theta).rate_at_start() == pytest.approx((first - second) / (1e-4 * first), rel=1e-4, abs=1e-9)
    steps = np.diag(1e-5 * theta)
    rises = [fitted(theta + step).rate_at_start() - fitted(theta - step).rate_at_start() for step in steps]
    np.testing.assert_allclose(fitted(theta).slopes_of_rate(), np.array(rises) / (2e-5 * theta), rtol=1e-6, atol=1e-9)
