"""Clock of a sensor: what a comparison of clocks changes, and what it cannot."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pipeline.bench.clock_rate import U_CRYSTAL, clock_rate
from pipeline.errors import TrackError
from pipeline.track import Track

ROOT3 = math.sqrt(3.0)
LIMITED = {"clock_limit": 0.01, "u_rate_error": 1e-5}
# Seconds of the recording, what is known of its clock, and the factor on frequencies, its u beside a crystal's, and
# whether the comparison is refused.
CASES: dict[str, tuple[float, dict[str, Any], float, float, bool]] = {
    "a crystal's row numbers": (1, {"clock": "nominal"}, 1.0, 0.0, False),
    "a crystal in the sensor": (1, {}, 1.0, 0.0, False),
    "a crystal in the host": (1, {"clock": "host"}, 1.0, 0.0, False),
    "two crystals 60 ppm apart": (1, {"rate_error": 60e-6, "u_rate_error": 5e-6}, 1.0, 0.0, False),
    "a ceramic resonator": (30, {"rate_error": 3e-3, "u_rate_error": 2e-5}, 1.003, 2e-5, False),
    "a second of stamps": (1, {"rate_error": 8e-3, "u_rate_error": 1e-2}, 1.0, 0.0, False),
    "3.6 ms of a busy host": (3, {"rate_error": 1.2e-3, "u_rate_error": 1e-5}, 1.0, 1.2e-3 / ROOT3, False),
    "36 ms are no busy host": (30, {"rate_error": 1.2e-3, "u_rate_error": 1e-5}, 1.0012, 1e-5, False),
    "3 s compared of 30": (
        *(30, {"rate_error": 1.2e-3, "u_rate_error": 1e-5, "compared_s": 3.0}),
        *(1.0, 1.2e-3 / ROOT3, False),
    ),
    "beyond the limit": (30, {**LIMITED, "rate_error": 0.03}, 1.0, 0.03 / ROOT3, True),
    "far beyond it": (30, {**LIMITED, "rate_error": -0.5}, 1.0, 0.5 / ROOT3, True),
    "no clock at all": (30, {**LIMITED, "rate_error": 1.017}, 1.0, 1.0 / ROOT3, True),
    "within the limit": (30, {**LIMITED, "rate_error": 9e-3}, 1.009, 1e-5, False),
    "a crystal's limit": (30, {**LIMITED, "clock_limit": 2e-4, "rate_error": 9e-3}, 1.0, 9e-3 / ROOT3, True),
    "a stall without a comparison": (30, {"clock_limit": 0.01, "held_samples": 2000}, 1.0, 0.0105 / ROOT3, True),
    "a stall beside a comparison": (
        *(30, {"clock_limit": 0.01, "held_samples": 1000, "rate_error": 1e-4, "u_rate_error": 2e-4}),
        *(1.0, 2e-4, False),
    ),
    "a coarse one": (
        *(30, {"clock_limit": 0.01, "held_samples": 1000, "rate_error": 1e-4, "u_rate_error": 0.5}),
        *(1.0, 0.0105 / ROOT3, False),
    ),
}


def track(seconds: float, **known: Any) -> Track:
    """Return a recording timed by the sensor, of so many seconds."""
    t = np.arange(100 * seconds + 1) / 100.0
    return replace(Track.from_arrays(t, np.zeros(t.size)), **{"clock": "device", **known})


@pytest.mark.parametrize("case", CASES)
def test_a_comparison_corrects_widens_or_is_refused(case: str) -> None:
    """Beside a crystal's 50 ppm: what the clocks may differ by, what two of them cannot, and what a stall hides."""
    seconds, known, value, u, refused = CASES[case]
    found = clock_rate(track(seconds, **known))
    assert found.rate.value == value
    assert found.rate.u == pytest.approx(value * math.hypot(u, U_CRYSTAL))
    assert found.refused == refused


@pytest.mark.parametrize(
    "wrong",
    [
        {"rate_error": 1e-3},
        {"rate_error": 1e-3, "u_rate_error": -1e-6},
        {"rate_error": math.nan, "u_rate_error": 1e-6},
        {"clock_limit": -1e-3},
        {"compared_s": math.nan},
        {"u_scale": -1e-3},
        {"u_offset_m": math.nan},
    ],
)
def test_impossible_uncertainties_are_refused(wrong: dict[str, float]) -> None:
    """Missing, negative or no numbers: one line, and no result."""
    with pytest.raises(TrackError, match=r"uncertainty that is not negative|finite and not negative"):
        clock_rate(track(1, **wrong))


def test_a_stated_clock_replaces_what_is_assumed() -> None:
    """A calibration corrects every time; a bound has the u of a rectangle, where no comparison contradicts it."""
    calibrated = clock_rate(track(30, clock_rate=(5e-3, 1e-6), rate_error=1e-3, u_rate_error=1e-5))
    assert calibrated.rate.value == 1.005
    assert calibrated.rate.u == 1e-6
    bound = clock_rate(track(30, clock_limit=2e-4, u_clock=2e-4 / ROOT3))
    assert (bound.rate.value, bound.rate.u) == (1.0, 2e-4 / ROOT3)
    assert clock_rate(track(30, clock_limit=2e-4, u_clock=1e-4, rate_error=9e-3, u_rate_error=1e-5)).refused
