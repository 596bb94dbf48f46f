"""The part of a recording that oscillates freely, and the time from which its amplitude and phase count."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.notice import Refusal
from pipeline.numerics.levels import FEWEST_FOR_CURVE, NEGLIGIBLE, ROUNDS
from pipeline.parts.clipping import find_clipping
from pipeline.parts.gaps import longest_part
from pipeline.parts.lost_rows import LostRows, find_lost_rows
from pipeline.parts.spans import Partition, Span, SpanKind, before_trigger, free_span
from pipeline.parts.stopping import moving_part
from pipeline.samples.condition import Samples, condition
from pipeline.track import Quality
from pipeline.windows.cycles import Cycles, find_cycles
from pipeline.windows.demodulate import Windows, demodulate, follow
from pipeline.windows.walk import Walk, walk_of

# Maximum residual of an oscillation over its amplitude: parabolas leave 0.20 and square waves 0.34, as measured on one
# period of each.
MOST_BENT = 0.25

# Share of the samples: if the bob stops before it, its rest is left out; if it stops before the end less this share,
# only if the whole recording shows no oscillation. With an eighth, rest long before the end is analysed, as measured
# by `python -m tests.trials.troubles --only before`.
EARLY = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """The part of a recording that swings freely, or the whole recording if nothing does.

    ``samples`` contains the whole recording, in which samples outside the part are flagged. ``partition`` describes the
    part (None for the whole recording), and ``stopped`` says whether friction stopped the bob in it. The times of the
    samples count rows that were ``lost``.
    """

    samples: Samples
    partition: Partition | None
    windows: Windows | Refusal
    stopped: bool = False
    lost: LostRows | None = None
    walk: Walk | None = None  # of amplitude and phase, if they wander at random

    def beginning(self, start_s: float) -> Partition | None:
        """Return the partition if the motion begins at a time, before which the bob was held."""
        first_s = float(self.samples.track.t[self.samples.used][0])
        if start_s <= first_s:
            return self.partition
        return Partition(start_s, math.inf, (Span(SpanKind.HANDLED, first_s, start_s),)).within(self.partition)


def find_part(samples: Samples) -> Part:
    """Find the part that oscillates freely; without cycles it is the whole recording."""
    part = _free_part(samples)
    return part if isinstance(part, Part) else Part(samples, None, part)


def _free_part(samples: Samples) -> Part | Refusal:
    """Return the part that oscillates freely, or why no cycles are found.

    The time before the trigger, the time long after the stop and all but one free part are left out. The samples are
    samples again after each step, because the part left out may have hidden the noise of the rest.
    """
    partition: Partition | None = None
    for find in (before_trigger, _long_after_stop, longest_part):
        if (outside := find(samples)) is not None:
            samples, partition = condition(outside.flagged(samples.track)), outside.within(partition)
    cycles, stopped = _cycles(samples)
    if isinstance(cycles, Refusal):
        # A long time in the hand hides the motion after it, which the later half may show.
        t = samples.track.t[samples.used]
        if t.size < 2 * FEWEST_FOR_CURVE:
            return cycles
        half_s = float(np.median(t))
        later = Partition(half_s, math.inf, (Span(SpanKind.HANDLED, float(t[0]), half_s),))
        trial = condition(later.flagged(samples.track))
        trimmed, stopped = _cycles(trial, 1.0 - EARLY)
        if isinstance(trimmed, Refusal):
            return cycles
        windows = demodulate(trial, trimmed)
        unclear = windows.noise > NEGLIGIBLE * float(np.max(windows.amplitude))
        if unclear or check_sinusoid(trial, windows) is not None:
            return cycles
        samples, partition = trial, later.within(partition)
        cycles = trimmed
    windows = demodulate(samples, cycles)
    if (lost := find_lost_rows(samples, windows)) is not None:
        samples = lost.samples
        cycles, stopped = _cycles(samples)
        if isinstance(cycles, Refusal):
            return cycles
        windows = demodulate(samples, cycles)
    if (walk := walk_of(windows)) is not None:
        return Part(samples, partition, windows, stopped, lost, walk)
    for _ in range(ROUNDS):
        outside = free_span(samples, windows)
        if outside is None:
            break
        # Windows of equal length are no whole periods of a wide pendulum, which would look like handling.
        if (followed := follow(windows, samples.track.t)) is not windows.cycles:
            along = demodulate(samples, followed)
            if free_span(samples, along) is None:
                windows = along
                break
        shorter = condition(outside.flagged(samples.track))
        trimmed, stops = _cycles(shorter)
        if isinstance(trimmed, Refusal):
            break
        samples, partition, stopped = shorter, outside.within(partition), stops
        windows = demodulate(samples, trimmed)
    if (followed := follow(windows, samples.track.t)) is not windows.cycles:
        windows = demodulate(samples, followed)
    if (clipped := find_clipping(samples, windows)) is not None:
        samples, windows = clipped, demodulate(clipped, windows.cycles)
    return Part(samples, partition, windows, stopped, lost)


def _long_after_stop(samples: Samples) -> Partition | None:
    """Return the part to keep of a recording whose bob stops early; None otherwise.

    Hours of rest would decide a fit to all samples.
    """
    moving = moving_part(samples, EARLY)
    if moving is None:
        return None
    t = samples.track.t[samples.used]
    # An equal time at rest is kept, because it shows the rest position and the noise.
    last_s = float(t[0] + 2.0 * (moving.track.t[-1] - t[0]))
    return Partition(-math.inf, last_s, (Span(SpanKind.AT_REST, last_s, float(t[-1])),))


def _cycles(samples: Samples, early: float = EARLY) -> tuple[Cycles | Refusal, bool]:
    """Return the cycles and whether the bob stops before a share of the samples; if so, those of the moving part."""
    cycles = find_cycles(samples)
    moving = moving_part(samples, 1.0 - EARLY if isinstance(cycles, Refusal) else early)
    if moving is None or isinstance(trimmed := find_cycles(moving), Refusal):
        return cycles, False
    return trimmed, True


def check_sinusoid(samples: Samples, windows: Windows) -> Refusal | None:
    """Return why the motion is no oscillation, although its spectrum has a peak; None if it is one.

    A step or a ramp has a peak in its spectrum too.
    """
    most = windows.amplitude.size * 9 // 10
    size = float(np.partition(windows.amplitude, most)[most])
    left = windows.noise
    if not size > 1e-12 * float(np.max(np.abs(windows.offset))):
        return Refusal("no_period")
    # Correlated noise, a drift or a random walk makes neighbouring samples more similar than white noise does.
    noise = samples.noise_of_reading
    # Both noises are estimated from the same n samples. For white noise the ratio of their squares has a variance of
    # 8.5/n. Five standard deviations are allowed: the largest difference in 2,000 records at -10 dB is 4.3.
    chance = 5.0 * math.sqrt(8.5 / max(float(np.sum(windows.count)), 1.0))
    excess = math.sqrt(max(left**2 - (1.0 + chance) * noise**2, 0.0))
    if left <= 0.15 * size or (left <= 4.0 * samples.noise and excess <= MOST_BENT * size):
        return None
    if left > MOST_BENT * size or windows.t.size < FEWEST_FOR_CURVE:
        return Refusal("bent", {"size_m": size, "left_m": left})
    return None


def start_of(samples: Samples, omega: float) -> float:
    """Return the time at which amplitude and phase are stated, s: that of the first row, even if it is a false echo.

    If at least one period is missing at the start, it is the time of the first sample used. A single false echo at the
    start must not change the time.
    """
    track = samples.track
    first = float(track.t[np.argmax(samples.used)])
    # A row with a wrong time cannot be the start.
    out = Quality.OUTSIDE | Quality.DUPLICATE_TIME | Quality.NON_MONOTONIC_TIME | Quality.MALFORMED
    rows = ((samples.flags & np.uint8(out)) == 0) & (track.t <= first)
    begin = float(np.min(track.t[rows], initial=first))
    return begin if first - begin < 2.0 * math.pi / omega else first
