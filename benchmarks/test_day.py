"""The day benchmark as a test: a quarter of an hour, whose memory is flat and whose log and run file are whole."""

from __future__ import annotations

import pytest

from benchmarks import day


@pytest.mark.trials
def test_memory_is_flat_and_every_reading_is_kept() -> None:
    """After the first minutes memory grows by less than 4 MB; log and run file hold 90,000 readings, within 200 MB."""
    seen, readings, dropped, cost = day.record(0.25, 3)
    assert seen[-1][1] - seen[0][1] < 4.0
    assert (readings, dropped) == (90_000, 0)
    assert cost.samples == 90_000
    assert cost.peak_mb < day.PEAK_MB
