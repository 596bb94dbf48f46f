"""What a person knows of the clock reaches the period and its u."""

from __future__ import annotations

import math

import pytest

import springmass as sm

RECORDING = sm.sample_data() / "damped_simulated_position.txt"


def test_a_calibrated_clock_corrects_the_period_and_its_u() -> None:
    """A clock that runs fast by 5,000 ppm shows a period too long by as much; 29 ppm are no longer assumed."""
    plain = sm.analyse(RECORDING)["T"]
    known = sm.analyse(RECORDING, scene={"sensor": {"clock_ppm": {"value": 5000.0, "u": 0.001}}})["T"]
    assert known.value == pytest.approx(plain.value / 1.005, rel=1e-9)
    assert known.u < 2e-7 < plain.u


def test_a_bound_of_the_clock_has_the_u_of_a_rectangle() -> None:
    """200 ppm at most are 115 ppm."""
    period = sm.analyse(RECORDING, clock_ppm=200.0)["T"]
    assert period.u == pytest.approx(period.value * 200e-6 / math.sqrt(3.0), rel=0.01)
