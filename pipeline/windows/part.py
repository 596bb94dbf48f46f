"""Part: stretches of a recording in which the bob is still, before its trigger or release or long after its stop."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np

from pipeline.samples.condition import Conditioned, condition
from pipeline.samples.stopping import moving_part
from pipeline.track import F8, UNUSABLE, Quality
from pipeline.windows.cycles import NoOscillation, find_cycles
from pipeline.windows.segments import Segments, Span, SpanKind

__all__ = ["before_release", "before_trigger", "long_after_stop"]

LEAST_AFTER = 64  # samples needed after a trigger or release to leave out the part before it
PIECES = 512  # pieces of a recording in which a bob is judged to be still or not
STILL = 0.1  # fraction of the range within which a held bob stays; a free one leaves it in a seventh of a period
NOISE = 8.0  # range of 25,000 samples of normal noise, in standard deviations
FAINT = 0.4  # fraction of the range; more noise hides whether a bob is still
TRIED = 16  # number of longest still stretches tried: a bob is held a few times, not at every turning point
RELEASED = 0.75  # fraction of the range that a released bob covers within half a period; lifting it covers half
HANGING = 0.25  # fraction of the range after the trigger within which a bob hangs still before it


def before_trigger(conditioned: Conditioned) -> Segments | None:
    """Return the part after the trigger, if the bob hung still before it; None otherwise.

    Parameters
    ----------
    conditioned : Conditioned
    """
    t, y, moment_s = conditioned.track.t, conditioned.track.y, conditioned.track.trigger_s
    if moment_s is None:
        return None
    before, after = conditioned.used & (t < moment_s), conditioned.used & (t >= moment_s)
    if not before.any() or np.count_nonzero(after) < LEAST_AFTER:
        return None
    # A bob that is already swinging triggers immediately, so there is no still part to leave out.
    ranges = [float(np.ptp(np.quantile(y[rows], (0.05, 0.95)))) for rows in (before, after)]
    if ranges[0] > HANGING * ranges[1]:
        return None
    return Segments(moment_s, math.inf, (Span(SpanKind.WAITING, float(t[before][0]), moment_s),))


def before_release(conditioned: Conditioned, *, periods: float) -> Segments | None:
    """Return the part after the release of a bob that hung still or was held; None without a release.

    Parameters
    ----------
    conditioned : Conditioned
    periods : float
        Periods of the motion that follows; a bob that is still for at least as many is held, or hangs at rest.

    Notes
    -----
    A free bob stays within a tenth of its range for a seventh of a period at most, at a turning point. So a longer
    still stretch is not part of a free motion. The first stretch after which the bob covers three quarters of the range
    within half a period ends with the release. The part after the motion is kept, since a bob comes to rest by itself.
    """
    track = conditioned.track
    # A plateau at which a hand holds the bob may have been flagged as clipped.
    rows = np.flatnonzero((conditioned.flags & UNUSABLE & ~np.uint8(Quality.CLIPPED)) == 0)
    if rows.size < LEAST_AFTER:
        return None
    t, y = track.t[rows], track.y[rows]
    low, high = (float(each) for each in np.quantile(y, (0.01, 0.99)))
    reach = max(STILL * (high - low), NOISE * max(conditioned.noise_m, conditioned.quantum_m or 0.0))
    if not 0.0 < reach < FAINT * (high - low):
        return None
    step_s = float(np.median(np.diff(t)))

    def covers(release: int, duration_s: float) -> bool:
        """Return whether the bob covers as much of the range within a duration as a released bob does."""
        near = y[release:][t[release:] < t[release] + duration_s]
        return near.size > 0 and float(np.ptp(near)) > RELEASED * (high - low)

    held: list[tuple[float, int]] = []  # duration of each still stretch, s, and row of its release
    longest = sorted(_still_runs(y, reach), key=lambda run: run[0] - run[1])[:TRIED]
    for first, stop in sorted(longest):
        away = np.abs(y[stop:] - float(np.median(y[first:stop]))) > reach
        if not away.any():
            continue
        release = stop + int(away.argmax())
        # Samples are counted, because the bob's motion in a gap is unknown. At least half must lie close together.
        still_s = min(release - first, 2 * (stop - first)) * step_s
        # Half a period cannot be longer than this if the still stretch lasts the required number of periods.
        if rows.size - release >= LEAST_AFTER and covers(release, 0.5 * still_s / periods):
            held.append((still_s, release))
    parts = {
        release: Segments(float(t[release]), math.inf, (Span(SpanKind.AT_REST, float(t[0]), float(t[release])),))
        for _, release in held
    }
    # The motion after the longest still stretch gives the period with which all stretches are compared.
    for _, begin in sorted(held, reverse=True):
        cycles = find_cycles(condition(parts[begin].flagged(track)))
        if not isinstance(cycles, NoOscillation):
            for still_s, release in held:
                if still_s * cycles.frequency_hz >= periods and covers(release, 0.5 / cycles.frequency_hz):
                    return parts[release]
            return None
    return None


def _still_runs(y: F8, reach: float) -> Iterator[tuple[int, int]]:
    """Yield first and stop of stretches of at least two pieces in which samples stay within a reach."""
    size = max(y.size // PIECES, 1)
    starts = np.arange(0, y.size, size)
    lows, highs = np.minimum.reduceat(y, starts).tolist(), np.maximum.reduceat(y, starts).tolist()
    begin, low, high = 0, math.inf, -math.inf
    for k, (least, most) in enumerate(itertools.chain(zip(lows, highs, strict=True), [(-math.inf, math.inf)])):
        low, high = min(low, least), max(high, most)
        if high - low > reach:
            if k - begin >= 2:
                yield begin * size, min(k * size, y.size)
            begin, low, high = k, least, most


def long_after_stop(conditioned: Conditioned, share: float) -> Segments | None:
    """Return the part to keep of a recording that continues long after its bob has stopped, or None.

    Parameters
    ----------
    conditioned : Conditioned
    share : float
        Share of the samples; a bob that moves for at least this share has not stopped long before the end.
    """
    moving = moving_part(conditioned, share)
    if moving is None:
        return None
    t = conditioned.track.t[conditioned.used]
    # An equal time at rest is kept, because it shows the rest position and the noise.
    last_s = float(t[0] + 2.0 * (moving.track.t[-1] - t[0]))
    return Segments(-math.inf, last_s, (Span(SpanKind.AT_REST, last_s, float(t[-1])),))
