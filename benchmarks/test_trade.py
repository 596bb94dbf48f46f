"""Test without timing limits that the comparison of methods runs and finds what it is about."""

from __future__ import annotations

import pytest

from benchmarks import trade


@pytest.mark.trials
def test_the_tiers_keep_the_bound_and_the_classic_method_does_not(tmp_path):
    """Three records: a tier stays within a few bounds of the frequency, the classic method is a hundred beyond."""
    rows = trade.measure(trade.MOTION, trade.Kind(), 3)
    assert rows["`standard`"][1]["frequency"] < 4.0
    assert rows["classic lab method"][1]["frequency"] > 100.0
    assert trade.table(1, tmp_path / "trade.svg").count("\n") == 9
    assert (tmp_path / "trade.svg").read_text("utf-8").startswith("<?xml")
