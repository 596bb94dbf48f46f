"""The median is numpy's to the last bit, and leaves the values as they were."""

from __future__ import annotations

import math
from random import Random

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.numerics.robust import median, median_size


@given(st.lists(st.floats(-1e150, 1e150), min_size=1, max_size=40))
def test_it_is_numpys(values: list[float]) -> None:
    """For an odd and an even number of values, with ties, of the values and of their sizes."""
    given_values = np.array(values)
    before = given_values.copy()
    assert median(given_values) == np.median(before)
    assert median_size(given_values) == np.median(np.abs(before))
    np.testing.assert_array_equal(given_values, before)


@given(st.lists(st.floats(-1e150, 1e150), min_size=1, max_size=40), st.integers(0, 5), st.randoms())
def test_what_is_not_finite_is_left_out(values: list[float], lost: int, random: Random) -> None:
    """With the count of the finite values, NaN and infinities among them change nothing."""
    mixed = [*values, *([math.nan, -math.inf, math.inf, math.nan, math.nan][:lost])]
    random.shuffle(mixed)
    assert median_size(np.array(mixed), len(values)) == np.median(np.abs(values))
