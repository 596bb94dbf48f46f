"""The rate of the clock that timed a record, with an uncertainty that no longer record reduces (Type B)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pipeline.errors import TrackError
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.levels import SIGNIFICANT
from pipeline.track import Quality, Track

# Relative standard uncertainty of a crystal's rate: 50 ppm, as in data sheets, as the half-width of a rectangle.
U_CRYSTAL = 50e-6 / math.sqrt(3.0)
# Maximum relative error of a host's clock, including its adjustment: the kernel slews by up to 500 ppm (RFC 5905).
HOST_LIMIT = 500e-6
# Time by which a host's time stamps may drift within a record although both clocks are right, s. A USB bridge delays
# bytes by up to 16 ms (data sheet FTDI AN232B-04), and a host that becomes busy wakes its readers later.
HOST_DELAY_S = 0.02


class ClockRate(NamedTuple):
    """The factor on every frequency of a record."""

    rate: Estimate  # 1 unless frequencies are corrected to the host's clock
    words: str  # its origin, for the effects table
    # Whether the clocks differ by more than both their errors allow, or held readings prevented a comparison.
    refused: bool = False


def clock_rate(track: Track) -> ClockRate:
    """Return the factor on every frequency of a track.

    A rate that the scene states replaces everything else, and a stated bound B the crystal's, with u = B/sqrt(3).

    A comparison of the sensor's clock with the host's gives their difference but not which of them is right. So it
    changes nothing as long as both can meet their specifications. Beyond three standard uncertainties the host is the
    reference (a ceramic resonator is off by thousands of ppm): frequencies are multiplied by 1 + r, and the uncertainty
    is that of the host's crystal and of the comparison.

    A drift within the record below the possible change of a host's delays (20 ms), and a difference beyond the limits
    of both clocks, are not corrected: they count as the half-width of a rectangular distribution. Where readings were
    delayed, the comparison's own uncertainty is added, up to that of the limit; without any comparison, the limit
    counts.

    >>> print(clock_rate(Track.from_arrays([0.0, 0.01], [0.2, 0.2])).rate)
    1.000000 +- 0.000029
    """
    if track.clock_rate is not None:
        fast, u_fast = track.clock_rate
        words = (
            f"the scene states {fast * 1e6:+.4g} ppm for the clock (u {u_fast * 1e6:.2g}): frequencies are corrected"
        )
        return ClockRate(Estimate(1.0 + fast, math.hypot(u_fast, _u_of_arrivals(track))), words)
    own = U_CRYSTAL if track.u_clock is None else track.u_clock
    spec = f"a crystal's {U_CRYSTAL * 1e6:.0f} ppm" if track.u_clock is None else f"the stated {own * 1e6:.2g} ppm"
    limit = math.inf if track.clock_limit is None else track.clock_limit + HOST_LIMIT
    if track.rate_error is None:
        return _uncompared(track, limit, own, spec)
    rate, u = track.rate_error, track.u_rate_error
    if u is None or not (math.isfinite(rate) and math.isfinite(u) and u >= 0):
        raise TrackError(
            f"a rate error needs a finite value and an uncertainty that is not negative, got {rate} and {u}",
            "leave both out where the clocks were not compared",
        )
    text = f"the device's clock runs {rate * 1e6:+.0f} ppm against the host's (u {u * 1e6:.0f} ppm)"
    if abs(rate) > limit:
        half = min(abs(rate), 1.0)
        words = (
            f"{text}, and {limit * 1e6:.0f} ppm are all that the two can be apart: nothing is corrected, and "
            f"{half * 1e6:.0f} ppm stand in every frequency's uncertainty as the half-width of a rectangle"
        )
        return ClockRate(_uncorrected(half), words, True)
    if abs(rate) > SIGNIFICANT * math.hypot(u, math.sqrt(2.0) * U_CRYSTAL):
        span_s = float(track.t[-1] - track.t[0])
        apart_s = abs(rate) * (span_s if track.compared_s is None else min(track.compared_s, span_s))
        if apart_s < HOST_DELAY_S:
            words = (
                f"{text}, {apart_s * 1e3:.2g} ms in all, which the host's delays may be too: nothing is corrected, and "
                "the difference stands in every frequency's uncertainty"
            )
            return ClockRate(_uncorrected(rate), words)
        words = f"{text}, more than two crystals can differ: frequencies are corrected to the host's"
        return ClockRate(Estimate(1.0 + rate, (1.0 + rate) * math.hypot(u, U_CRYSTAL)), words)
    found = Estimate(1.0, own)
    if track.held_samples:
        found = _uncorrected(min(math.sqrt(3.0) * u, limit, 1.0))
        spec = f"{found.u * 1e6:.0f} ppm"
    return ClockRate(found, f"{text}, as two crystals may: {spec} stand in every frequency's uncertainty")


def _uncorrected(half: float) -> Estimate:
    """Return the factor 1 with the uncertainty of a crystal and of a difference of this half-width."""
    return Estimate(1.0, math.hypot(U_CRYSTAL, half / math.sqrt(3.0)))


def _uncompared(track: Track, limit: float, own: float, spec: str) -> ClockRate:
    """Return the factor for a clock without a comparison; delays may have prevented one."""
    if track.clock == "device" and track.held_samples:
        half = min(limit, 1.0)
        words = (
            "too few readings came in time to compare the device's clock with the host's: the "
            f"{half * 1e6:.0f} ppm that they may be apart stand in every frequency's uncertainty as the half-width of "
            "a rectangle"
        )
        return ClockRate(_uncorrected(half), words, True)
    source = {"nominal": "are row numbers over the nominal rate", "host": "are the host's"}
    times = source.get(track.clock, "were measured by the device")
    if u_rate := _u_of_arrivals(track):
        times, spec = "follow from arrivals", f"{spec.removesuffix(' ppm')} and their {u_rate * 1e6:.2g} ppm"
    rate = Estimate(1.0, math.hypot(own, u_rate))
    return ClockRate(rate, f"times {times}: {spec} stand in every frequency's uncertainty")


def _u_of_arrivals(track: Track) -> float:
    """Return the relative standard uncertainty of the rate of times that follow from arrivals.

    Where the places of lost samples are wrong, the times run off by one step and jump back. The duration of a whole
    recording is wrong by any part of a step; a part that ends where the phase jumps runs off by all of it.
    """
    if not track.misplaced_s:
        return track.u_rate
    inside = (track.flags & Quality.OUTSIDE) == 0
    run_off_s = track.misplaced_s * (1.0 / math.sqrt(12.0) if inside.all() else 1.0)
    return math.hypot(track.u_rate, run_off_s / float(np.ptp(track.t[inside])))
