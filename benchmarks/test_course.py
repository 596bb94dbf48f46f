"""Test without timing limits that the benchmark of courses runs and gives the expected results."""

from __future__ import annotations

import sys

import pytest

from benchmarks import course


@pytest.mark.trials
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads what processes use from /proc")
def test_a_course_is_measured(tmp_path):
    """Every ratio is positive, and a worker's memory is below its limit."""
    measured = course.measure(6, tmp_path)
    assert min(measured.fast, measured.standard, measured.same_answer, measured.efficiency) > 0
    assert measured.half_mb <= measured.whole_mb < 250
