"""The spread that a median tells: a normal one's, whatever a few wide values are."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from pipeline.numerics.robust import MAD_TO_SIGMA, mad_sigma


def test_the_factor_is_that_of_the_normal_distribution() -> None:
    """Half of a normal distribution lies within one standard deviation over the factor."""
    assert norm.cdf(1.0 / MAD_TO_SIGMA) - norm.cdf(-1.0 / MAD_TO_SIGMA) == pytest.approx(0.5, rel=1e-12)


@pytest.mark.parametrize("count", [4001, 4000])
def test_a_tenth_of_wide_values_hardly_widens_it(count: int) -> None:
    """Of normal deviations, of which a tenth are a thousand times as wide, it gives the narrow ones' within 20 %."""
    deviation = 0.3 * np.random.default_rng(5).standard_normal(count)
    assert mad_sigma(deviation) == pytest.approx(0.3, rel=0.05)
    deviation[::10] *= 1e3
    before = deviation.copy()
    assert mad_sigma(deviation) == pytest.approx(0.3, rel=0.2)
    np.testing.assert_array_equal(deviation, before)
