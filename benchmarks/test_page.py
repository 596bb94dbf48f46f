"""Test that the benchmark of the page runs."""

from __future__ import annotations

import pytest

from benchmarks import page


@pytest.mark.trials
def test_the_page_is_measured() -> None:
    """Two viewers receive samples for two seconds, a suspended one receives them later, and all costs are measured."""
    found = page.measure(2.0, 2, 1.0)
    assert 0.0 <= found["cpu"] < 1.5
    assert 0.0 <= found["p50_s"] <= found["p95_s"]
    assert 0.0 <= found["serving"] < 1.5
    assert found["current_s"] > 0.0
    assert 0.0 <= page.floor(1.0) < 1.5
