"""Clock and scale of a sensor: what a comparison of clocks changes, and what it cannot."""

from __future__ import annotations

import math
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

from pipeline.analyse import analyse
from pipeline.bench.instrument import U_CRYSTAL, Instrument
from pipeline.errors import TrackError
from pipeline.track import Track

PLAIN = Track.from_arrays(np.arange(100) / 100.0, np.zeros(100))
LONG = Track.from_arrays(np.arange(3000) / 100.0, np.zeros(3000))


@pytest.mark.parametrize("clock", ["nominal", "device", "host"])
def test_a_clock_alone_is_as_good_as_its_crystal(clock: str) -> None:
    """50 ppm, half-width of a rectangle, whatever kept the time; no frequency is corrected."""
    found = Instrument.of(replace(PLAIN, clock=clock))
    assert (found.clock_rate.value, found.clock_rate.u) == (1.0, pytest.approx(50e-6 / math.sqrt(3)))
    assert "29 ppm" in found.clock_words


def test_two_crystals_may_differ() -> None:
    """60 ppm between two clocks is within what their crystals allow: nothing is corrected."""
    found = Instrument.of(replace(PLAIN, clock="device", rate_error=60e-6, u_rate_error=5e-6))
    assert (found.clock_rate.value, found.clock_rate.u) == (1.0, U_CRYSTAL)
    assert "+60 ppm" in found.clock_words


def test_a_ceramic_resonator_is_corrected_to_the_host() -> None:
    """3000 ppm are no crystal's: frequencies are multiplied by 1.003, and the host's crystal remains."""
    found = Instrument.of(replace(LONG, clock="device", rate_error=3e-3, u_rate_error=2e-5))
    assert found.clock_rate.value == 1.003
    assert found.clock_rate.u == pytest.approx(1.003 * math.hypot(2e-5, U_CRYSTAL))
    assert "corrected" in found.clock_words


def test_a_comparison_too_coarse_to_tell_changes_nothing() -> None:
    """A second of stamps knows the rate to a part in a hundred: it overrules nobody."""
    found = Instrument.of(replace(PLAIN, clock="device", rate_error=8e-3, u_rate_error=1e-2))
    assert (found.clock_rate.value, found.clock_rate.u) == (1.0, U_CRYSTAL)


def test_a_host_that_became_busy_overrules_nobody() -> None:
    """Stamps that drift by 3.6 ms in three seconds are no clock's fault: the difference is an uncertainty only."""
    short = Track.from_arrays(np.arange(301) / 100.0, np.zeros(301))
    found = Instrument.of(replace(short, clock="device", rate_error=1.2e-3, u_rate_error=1e-5))
    assert found.clock_rate.value == 1.0
    assert found.clock_rate.u == pytest.approx(math.hypot(1.2e-3 / math.sqrt(3), U_CRYSTAL))
    assert "3.6 ms" in found.clock_words
    # The same rate over half a minute is 36 ms: more than any delay.
    assert Instrument.of(replace(LONG, clock="device", rate_error=1.2e-3, u_rate_error=1e-5)).clock_rate.value > 1.001


def test_period_is_corrected(synthetic: ModuleType) -> None:
    """A device that counts 1.002 s in a second shows periods 0.2 % too long; analyse gives the true one."""
    t = synthetic.times(20)
    truth = synthetic.Truth()
    y = synthetic.noisy(truth, t, 3e-4, 1)
    track = replace(Track.from_arrays(t * 1.002, y), clock="device", rate_error=2e-3, u_rate_error=1e-6)
    found = analyse(track).estimates["period"]
    assert abs(found.value - truth.period) < 3 * found.u
    assert found.u < 5e-5 * found.value


@pytest.mark.parametrize(
    "wrong",
    [
        {"rate_error": 1e-3},
        {"rate_error": 1e-3, "u_rate_error": -1e-6},
        {"rate_error": math.nan, "u_rate_error": 1e-6},
        {"u_scale": -1e-3},
        {"u_offset_m": math.nan},
    ],
)
def test_impossible_uncertainties_are_refused(wrong: dict[str, float]) -> None:
    """Missing, negative or no numbers: one line, and no result."""
    with pytest.raises(TrackError, match=r"uncertainty that is not negative|finite and not negative"):
        Instrument.of(replace(PLAIN, **wrong))
