"""Many runs of a course: scatter between and within benches, and runs noted wrongly."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.numerics.estimate import Estimate
from pipeline.results.course import agreement


def test_scatter_within_and_between_is_what_was_put_in():
    """Over 400 benches of 5 runs the moments come back within some percent, and the mean within its uncertainty."""
    rng = np.random.default_rng(3)
    benches = np.repeat(np.arange(400), 5)
    values = 14.0 + 0.05 * rng.standard_normal(400)[benches] + 0.02 * rng.standard_normal(2000)
    found = agreement("k", "", [Estimate(float(x), 0.01, "N/m") for x in values], [str(b) for b in benches])
    assert found.within == pytest.approx(0.02, rel=0.05)
    assert found.between == pytest.approx(0.05, rel=0.1)
    assert abs(found.mean.value - 14.0) < 3.0 * found.mean.u
    assert found.mean.u == pytest.approx(0.05 / 20.0, rel=0.15)
