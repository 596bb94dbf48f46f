"""The median is numpy's to the last bit, and leaves the values as they were."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.median import median, median_size


@given(st.lists(st.floats(-1e150, 1e150), min_size=1, max_size=40))
def test_it_is_numpys(values: list[float]) -> None:
    """For an odd and an even number of values, with ties, of the values and of their sizes."""
    given_values = np.array(values)
    before = given_values.copy()
    assert median(given_values) == np.median(before)
    assert median_size(given_values) == np.median(np.abs(before))
    np.testing.assert_array_equal(given_values, before)
