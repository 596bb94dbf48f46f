"""What no bob on a spring does, and no distance sensor sees, is reported."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.analyse import analyse
from pipeline.track import Track


def codes(amplitude: float, hz: float, *, rest: float = 0.3, rate_hz: float = 100.0, seconds: float = 20.0) -> set[str]:
    """Return the codes of the warnings on a sinusoid in little noise."""
    t = np.arange(round(seconds * rate_hz)) / rate_hz
    rng = np.random.default_rng(3)
    y = rest + amplitude * np.cos(2.0 * math.pi * hz * t + 0.3) + 0.005 * amplitude * rng.standard_normal(t.size)
    return {f.code for f in analyse(Track.from_arrays(t, y)).findings if f.severity != "info"}


def test_bob_is_plausible() -> None:
    """A bob of 50 mm at 1.32 Hz, 0.3 m away, gets no warning."""
    assert codes(0.05, 1.32) == set()


def test_distances_in_another_unit() -> None:
    """Centimetres read as metres lie beyond the range, and move too fast."""
    assert {"implausible_distance", "implausible_motion"} <= codes(5.0, 1.32, rest=30.0)


def test_times_in_another_unit() -> None:
    """Milliseconds read as seconds: a spring of 142 km; a period of 9 s is long, and may be."""
    assert codes(0.05, 1.32e-3, rate_hz=0.1, seconds=20_000.0) == {"implausible_sag"}
    assert codes(0.05, 1.0 / 9.0, rate_hz=10.0, seconds=200.0) == set()


def test_positions_of_both_signs_are_counted_from_rest() -> None:
    """They are ordinary in files of videos and of zeroed sensors, unless they are out of all range."""
    assert codes(0.05, 1.32, rest=0.0) == set()
    assert "implausible_distance" in codes(0.05, 1.32, rest=0.05)
    assert "implausible_distance" in codes(13.0, 1.32, rest=0.0)


def test_what_cannot_be_is_uncertain_by_as_much() -> None:
    """Millimetres read as centimetres leave an amplitude that is no better than a guess, and the period as it is."""
    t = np.arange(2000) / 100.0
    noise = np.random.default_rng(3).standard_normal(t.size)
    unit = analyse(Track.from_arrays(t, 10.0 * (0.3 + 0.05 * np.cos(8.3 * t) + 3e-4 * noise))).estimates
    assert unit["amplitude"].u > 0.5 * unit["amplitude"].value
    assert unit["period"].u < 1e-3 * unit["period"].value


@pytest.mark.parametrize(("hz", "rate_hz"), [(50.0, 500.0), (50.0, 120.0), (60.0, 500.0)])
def test_the_mains_are_no_bob(hz: float, rate_hz: float) -> None:
    """A line of 0.5 mm at the mains frequency needs more than gravity, and leaves no amplitude worth quoting."""
    t = np.arange(round(20.0 * rate_hz)) / rate_hz
    rng = np.random.default_rng(3)
    y = 0.3 + 5e-4 * np.cos(2.0 * math.pi * hz * t + 0.3) + 2.5e-6 * rng.standard_normal(t.size)
    result = analyse(Track.from_arrays(t, y))
    (finding,) = (f for f in result.findings if f.code == "implausible_motion")
    assert finding.values["gravities"] == pytest.approx(5e-4 * (2.0 * math.pi * hz) ** 2 / 9.81, rel=0.02)
    assert finding.values["frequency_hz"] == pytest.approx(hz, rel=1e-4)
    assert result.estimates["amplitude"].u > 0.5 * result.estimates["amplitude"].value


def test_fewer_than_four_samples_a_period() -> None:
    """At 3.4 samples a period the record may show another frequency than the bob's."""
    assert "undersampled" in codes(0.05, 1.32, rate_hz=1.32 * 3.4, seconds=60.0)
