"""The benchmark of the page runs."""

from __future__ import annotations

import pytest

from benchmarks import page


@pytest.mark.trials
def test_the_page_is_measured() -> None:
    """Two viewers for two seconds: samples arrive, a suspended one gets them later, and the page's process is found."""
    found = page.measure(2.0, 2, 1.0)
    assert 0.0 <= found["cpu"] < 1.5
    assert 0.0 <= found["p50_s"] <= found["p95_s"]
    assert 0.0 <= found["serving"] < 1.5
    assert found["current_s"] > 0.0
    assert 0.0 <= page.floor(1.0) < 1.5
