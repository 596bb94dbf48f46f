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
from pipeline.findings.samples import clock_findings
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


@pytest.mark.parametrize(("rate", "half"), [(1.017, 1.0), (-0.5, 0.5), (0.03, 0.03), (0.0106, 0.0106)])
def test_a_correction_that_no_clock_can_need_is_refused(rate: float, half: float) -> None:
    """Beyond the clock's limit and the host's 500 ppm the difference is a rectangle's half-width, and nothing else."""
    track = replace(LONG, clock="device", rate_error=rate, u_rate_error=1e-5, clock_limit=0.01)
    found = Instrument.of(track)
    assert (found.clock_rate.value, found.clock_refused) == (1.0, True)
    assert found.clock_rate.u == pytest.approx(math.hypot(half / math.sqrt(3.0), U_CRYSTAL))
    assert not Instrument.of(replace(track, clock_limit=1.1 * abs(rate))).clock_refused
    (finding,) = clock_findings(track)
    assert finding.code == "clock_refused"


def test_a_correction_within_the_limit_is_made() -> None:
    """A resonator's 9000 ppm are corrected under a limit of 10 000, and of a crystal's 200 refused."""
    track = replace(LONG, clock="device", rate_error=9e-3, u_rate_error=1e-5, clock_limit=0.01)
    assert Instrument.of(track).clock_rate.value == 1.009
    assert Instrument.of(replace(track, clock_limit=2e-4)).clock_refused


def test_a_stall_that_leaves_no_comparison_leaves_the_clock_at_its_limit() -> None:
    """With too few stamps in time the clock may be anything within its limit; without a stall it is a crystal."""
    track = replace(LONG, clock="device", clock_limit=0.01)
    assert Instrument.of(track).clock_rate.u == U_CRYSTAL
    stalled = replace(track, held_samples=2000, longest_stall_s=13.0)
    found = Instrument.of(stalled)
    assert found.clock_refused
    assert found.clock_rate.u == pytest.approx(math.hypot(0.0105 / math.sqrt(3.0), U_CRYSTAL))
    assert [finding.code for finding in clock_findings(stalled)] == ["clock_refused", "late_readings"]


def test_a_comparison_that_a_stall_made_coarse_counts_as_coarse() -> None:
    """Its uncertainty is added, never more than the limit's."""
    track = replace(LONG, clock="device", rate_error=1e-4, u_rate_error=2e-4, clock_limit=0.01, held_samples=1000)
    assert Instrument.of(track).clock_rate.u == pytest.approx(math.hypot(2e-4, U_CRYSTAL))
    coarse = Instrument.of(replace(track, u_rate_error=0.5))
    assert coarse.clock_rate.u == pytest.approx(math.hypot(0.0105 / math.sqrt(3.0), U_CRYSTAL))


def test_a_short_comparison_in_a_long_record_overrules_nobody() -> None:
    """Three seconds before a stall tell 3.6 ms of drift, however long the record goes on."""
    track = replace(LONG, clock="device", rate_error=1.2e-3, u_rate_error=1e-5, compared_s=3.0)
    assert Instrument.of(track).clock_rate.value == 1.0


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
        {"clock_limit": -1e-3},
        {"clock_limit": math.inf},
        {"compared_s": math.nan},
        {"u_scale": -1e-3},
        {"u_offset_m": math.nan},
    ],
)
def test_impossible_uncertainties_are_refused(wrong: dict[str, float]) -> None:
    """Missing, negative or no numbers: one line, and no result."""
    with pytest.raises(TrackError, match=r"uncertainty that is not negative|finite and not negative"):
        Instrument.of(replace(PLAIN, **wrong))
