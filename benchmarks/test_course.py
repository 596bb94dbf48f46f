"""Test without timing limits that the benchmark of courses runs and gives the expected results."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from benchmarks import course


def test_a_search_finds_what_numpy_finds():
    """The search matches about a tenth of an eighth of the rows."""
    _, found = course.search_s(4000)
    assert found == pytest.approx(4000 / 80, abs=4 * np.sqrt(4000 / 80))


@pytest.mark.trials
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads what processes use from /proc")
def test_a_course_is_measured(tmp_path):
    """Every ratio is positive, and a worker's memory is below its limit."""
    measured = course.measure(6, tmp_path)
    assert min(measured.fast, measured.standard, measured.same_answer, measured.efficiency) > 0
    assert measured.half_mb <= measured.whole_mb < 250
