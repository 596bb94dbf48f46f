"""Test the ports benchmark without timing limits: a plan must receive and record every sample."""

from __future__ import annotations

import dataclasses

import pytest

from benchmarks import ports


@pytest.mark.parametrize(("count", "rate_hz"), [(1, 1000.0), (16, 100.0)])
def test_every_sample_is_received_and_recorded(count: int, rate_hz: float) -> None:
    """One port at 1 kHz and sixteen at 100 Hz deliver every sample of 0.3 s, and the log contains every line."""
    figures = ports.measure(ports=count, rate_hz=rate_hz, seconds=0.3)
    assert figures.received == figures.expected == figures.recorded == round(count * rate_hz * 0.3)
    assert 0.0 < figures.p50_ms <= figures.p99_ms < ports.PATIENCE_S * 1e3


@pytest.mark.parametrize("wrong", [{"received": 99}, {"recorded": 99}, {"p50_ms": 1.01}])
def test_a_lost_sample_or_a_late_one_breaks_a_limit(wrong: dict[str, float]) -> None:
    """Exceeding any single limit is detected, and results within all limits pass."""
    figures = ports.Figures(100, 100, 100, 0.02, 0.9, 3.0)
    assert not figures.broken
    assert dataclasses.replace(figures, **wrong).broken
    assert "(0.90 of its limit)" in figures.line("1 x 100 Hz")
