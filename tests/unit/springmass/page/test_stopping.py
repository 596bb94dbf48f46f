"""The forecast of how long to go on comes true."""

from __future__ import annotations

import math

import numpy as np
import pytest

from springmass.page.stopping import more_seconds


@pytest.mark.parametrize("rate_per_s", [0.0, 0.01, 0.05])
def test_the_time_foretold_is_that_of_the_fisher_information(rate_per_s: float) -> None:
    """Of a sine with a known law of decay, by sums over its samples instead of integrals."""

    def u_of(seconds: float) -> float:
        t = np.arange(0.0, seconds, 0.01)
        weight = np.exp(-2.0 * rate_per_s * t)
        return float((np.sum(weight * t**2) - np.sum(weight * t) ** 2 / np.sum(weight)) ** -0.5)

    now, wanted = u_of(15.0), u_of(24.0)
    found = more_seconds(now, wanted, 15.0, lambda t: np.exp(-rate_per_s * t))
    assert found == pytest.approx(9.0, rel=0.03)


def test_what_a_dying_swing_cannot_give_is_said() -> None:
    """The information of a swing that dies out is bounded; what has been reached takes no more time."""
    assert more_seconds(1.0, 0.1, 60.0, lambda t: np.exp(-0.1 * t)) == math.inf
    assert more_seconds(1.0, 1.0, 60.0, np.ones_like) == 0.0
