"""Partition: the part of a record with one free oscillation, and the handling before, between and after.

The amplitude of a free oscillation decays smoothly and its phase advances steadily. This does not hold for a bob that
hangs still, is lifted, held or caught. At a restart, a touch, lost rows or a stopped clock, amplitude or phase jumps
from one period to the next.
"""

from __future__ import annotations

import itertools
import math
import sys
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.levels import FALSE_ALARM, FEWEST_FOR_CURVE, FEWEST_FOR_LINE, NEGLIGIBLE, normal_quantile
from pipeline.numerics.robust import median
from pipeline.parts.change_points import find_changes, lone_points
from pipeline.samples.condition import Samples
from pipeline.track import F8, Quality, Track
from pipeline.windows.demodulate import FINEST, Windows

LARGEST_EXPONENT = math.log(math.sqrt(sys.float_info.max))
ADJACENT = FEWEST_FOR_LINE  # number of windows beside a break or still windows from which the motion is extrapolated
# Minimum amplitude of a part relative to the largest one; a smaller motion is a remnant of handling. With 0.1, the 167
# samples in a hand are analysed too, as measured by `python -m tests.golden --only torsione`.
SHARE = 0.2
# Minimum share of a record after the motion is lost in the noise for this rest to be left out; a shorter one does not
# impair a fit. With 0.1, a pendulum loses 211 samples, as measured by `python -m tests.golden --only plasduino`.
REST_SHARE = 0.3
# Maximum decrease of the logarithm of the amplitude per window, after the maximum, for which jumps are searched. The
# sinusoid of a window has a single decay rate. At a stronger decay its error, the square of the decrease (0.4 %),
# exceeds the noise and is largest at the start of the motion. With 0.1, a bob that friction stops counts as handled, as
# measured by `python -m tests.trials.troubles --only friction`.
MOST_FALL = 0.06


class SpanKind(StrEnum):
    """State of the bob during a part that was left out."""

    AT_REST = "at_rest"  # nothing but noise
    WAITING = "waiting"  # only noise, up to the recording's own trigger
    HANDLED = "handled"  # neither still nor free
    FREE = "free"  # another free oscillation
    GAP = "gap"  # unknown, because nothing was recorded


class BreakKind(StrEnum):
    """Kind of the transition from one free oscillation to another."""

    RESTARTED = "restarted"  # with a pause between
    TOUCHED = "touched"  # the amplitude jumps
    PHASE_JUMP = "phase_jump"  # the phase alone


@dataclass(frozen=True, slots=True)
class Span:
    """A stretch of a record that was left out."""

    kind: SpanKind
    first_s: float
    last_s: float


@dataclass(frozen=True, slots=True)
class Break:
    """Where one free oscillation ends and another begins."""

    kind: BreakKind
    time_s: float
    amplitude: float  # relative change of the amplitude
    phase: float  # change of the phase, rad


@dataclass(frozen=True, slots=True)
class Partition:
    """The part of a record that is analysed, and the parts that are left out."""

    # first_s, last_s: start and end of the analysed part, s.
    first_s: float
    last_s: float
    left_out: tuple[Span, ...]  # in order of time
    breaks: tuple[Break, ...] = ()  # in order of time

    def flagged(self, track: Track) -> Track:
        """Return a track with the samples outside the part flagged."""
        outside = ~((track.t >= self.first_s) & (track.t <= self.last_s))
        return replace(track, flags=track.flags | np.where(outside, np.uint8(Quality.OUTSIDE), np.uint8(0)))

    def within(self, before: Partition | None) -> Partition:
        """Combine this partition with an earlier one, within whose part they were found."""
        if before is None:
            return self
        spans = sorted((*before.left_out, *self.left_out), key=lambda span: span.first_s)
        breaks = sorted((*before.breaks, *self.breaks), key=lambda each: each.time_s)
        first_s, last_s = max(self.first_s, before.first_s), min(self.last_s, before.last_s)
        return Partition(first_s, last_s, tuple(spans), tuple(breaks))


def before_trigger(samples: Samples) -> Partition | None:
    """Return the part after the trigger, if the bob hung still before it; None otherwise."""
    t, y, moment_s = samples.track.t, samples.track.y, samples.track.trigger_s
    if moment_s is None:
        return None
    before, after = samples.used & (t < moment_s), samples.used & (t >= moment_s)
    if not before.any() or np.count_nonzero(after) < FEWEST_FOR_CURVE:
        return None
    # A bob that is already swinging triggers immediately, so there is no still part to leave out.
    still, swing = (float(np.ptp(np.quantile(y[rows], (0.05, 0.95)))) for rows in (before, after))
    if still > NEGLIGIBLE * swing + 2.0 * normal_quantile(0.9) * samples.noise:
        return None
    return Partition(moment_s, math.inf, (Span(SpanKind.WAITING, float(t[before][0]), moment_s),))


def free_span(samples: Samples, windows: Windows) -> Partition | None:
    """Return the longest part with one free oscillation; None if this is the whole record.

    The maximum amplitude of n windows without any motion exceeds :math:`r u = \\sqrt{2 \\ln(n/\\alpha)}\\,u` with
    probability :math:`\\alpha` (Rayleigh distribution). Windows below this are still if a straight line through their
    neighbours' amplitudes extrapolates to more than twice this value. Between still windows the record is split where
    amplitude or phase jumps, see :func:`pipeline.parts.change_points.find_changes`. The record's median decay and
    frequency are removed first, so that a cubic can follow the remainder. The moment of a touch within its window is
    unknown, so a window on either side of a jump is left out.
    """
    if windows.t.size < 2 * FEWEST_FOR_LINE:
        return None
    series = _Series.of(windows)
    moving = series.moving()
    if moving < (1.0 - REST_SHARE) * series.t.size:
        return _faded(series, moving)
    if series.fall > MOST_FALL:
        return _released(series)
    return _chosen(series, series.parts(), samples)


class _WindowSpan(NamedTuple):
    """Windows first to stop - 1: all still, or moving without a jump."""

    first: int
    stop: int
    still: bool


@dataclass(frozen=True, slots=True, eq=False)
class _Series:
    """The windows in a frame that rotates with the oscillation.

    ``values`` (2, w) are amplitude, m, and phase, rad, without the record's median decay and frequency; ``u`` (2, w)
    are their uncertainties. ``size`` (w,) is the amplitude itself. ``far`` is the maximum of pure noise, in standard
    uncertainties, and ``weak`` (w,) says whether noise alone can explain the amplitude.
    """

    t: F8
    values: F8
    u: F8
    size: F8
    far: float
    weak: NDArray[np.bool_]

    @classmethod
    def of(cls, windows: Windows) -> _Series:
        t, size = windows.t, np.abs(windows.amplitude)
        least = 1e-12 * float(size.max()) + 1e-150
        u = np.maximum(np.sqrt(windows.covariance[:, 0, 0]), np.maximum(FINEST * size, least))
        far = math.sqrt(2.0 * math.log(t.size / FALSE_ALARM))
        strong = size > far * u
        both = strong[1:] & strong[:-1]
        omega, rate = windows.angular_frequency, 0.0
        if both.any():
            step = np.diff(t)[both]
            omega = median(np.diff(windows.phase)[both] / step)
            rate = median(-np.diff(np.log(np.maximum(size, least)))[both] / step)
        turned = windows.amplitude * np.exp(1j * (windows.phase - omega * t))
        phase, u_phase = np.unwrap(np.angle(turned)), u / np.maximum(size, u)
        steady = np.exp(np.clip(rate * (t - t[0]), -LARGEST_EXPONENT, LARGEST_EXPONENT))
        return cls(t, np.array([size * steady, phase]), np.array([u * steady, u_phase]), size, far, ~strong)

    @property
    def spacing(self) -> float:
        """Time between windows, s."""
        return median(np.diff(self.t))

    @property
    def fall(self) -> float:
        """Median decrease of the logarithm of the amplitude per window, after the maximum."""
        first = int(np.argmax(self.size))
        steps = -np.diff(np.log(np.maximum(self.size[first : first + ADJACENT + 3], self.u[0, first])))
        return median(steps) if steps.size else 0.0

    def moving(self) -> int:
        """Return the number of windows up to the last two in succession that exceed the noise."""
        pairs = np.flatnonzero(~self.weak[1:] & ~self.weak[:-1])
        return int(pairs[-1]) + 2 if pairs.size else 0

    def parts(self) -> list[_WindowSpan]:
        """Split the record into runs of still windows and the parts between jumps."""
        edges = np.flatnonzero(np.diff(np.concatenate([[False], self.weak, [False]])))
        parts, begin = [], 0
        for first, stop in edges.reshape(-1, 2).tolist():
            if self.stands_still(first, stop):
                parts += [*self.between_jumps(begin, first), _WindowSpan(first, stop, True)]
                begin = stop
        return [*parts, *self.between_jumps(begin, self.t.size)]

    def stands_still(self, first: int, stop: int) -> bool:
        """Return whether moving windows beside weak ones extrapolate to over twice the limit of noise there."""
        before, after = (
            np.flatnonzero(~self.weak[:first])[-ADJACENT:],
            stop + np.flatnonzero(~self.weak[stop:])[:ADJACENT],
        )
        return any(
            rows.size >= ADJACENT and self.continued(rows, k)[0] > 2.0 * self.far * self.u[0, k]
            for rows, k in ((before, first), (after, stop - 1))
        )

    def continued(self, rows: NDArray[np.int64], k: float) -> F8:
        """Return (2,): the values extrapolated to window k along straight lines with median slopes."""
        t = self.t[rows] - np.interp(k, np.arange(self.t.size), self.t)
        slope = np.median(np.diff(self.values[:, rows]) / np.diff(t), axis=1)
        return np.asarray(np.median(self.values[:, rows] - slope[:, None] * t, axis=1))

    def between_jumps(self, first: int, stop: int) -> list[_WindowSpan]:
        """Split windows first to stop - 1 at their jumps."""
        if stop - first < ADJACENT:
            return [_WindowSpan(first, stop, False)] if stop > first else []
        values, u = self.values[:, first:stop], self.u[:, first:stop]
        rows = np.flatnonzero(~lone_points(values, u, FALSE_ALARM))
        changes = find_changes(self.t[first + rows], values[:, rows], u[:, rows])
        edges = [first, *(first + int(rows[k]) for k in changes), stop]
        return [_WindowSpan(a, b, False) for a, b in itertools.pairwise(edges)]


def _chosen(series: _Series, parts: list[_WindowSpan], samples: Samples) -> Partition | None:
    """Return the longest of the parts that oscillate freely, with the spans and breaks beside it."""
    if len(parts) == 1:
        return None
    n = series.t.size
    # A window beside a jump may contain part of the disturbance there.
    limits = [(part.first + (part.first > 0), part.stop - (part.stop < n)) for part in parts]
    # In a long decay the amplitude is small for most of the time, so its beginning counts too.
    sizes = [series.size[part.first : part.stop] for part in parts]
    size = np.array([max(median(each), median(each[:ADJACENT])) for each in sizes])
    length = np.array([stop - first for first, stop in limits])
    free = ~np.array([part.still for part in parts]) & (length >= FEWEST_FOR_LINE)
    if not free.any():
        return None
    free &= size > SHARE * size[free].max()
    chosen = int(np.argmax(np.where(free, length, 0)))
    t = samples.track.t[samples.used]
    begin_s, end_s, half = float(t[0]), float(t[-1]), 0.5 * series.spacing

    def seconds(first: int, stop: int) -> tuple[float, float]:
        """Return the times at the beginning of window first and the end of window stop - 1."""
        first_s = begin_s if first == 0 else float(series.t[first]) - half
        return first_s, end_s if stop == n else float(series.t[stop - 1]) + half

    spans, before = [], begin_s
    for k, part in enumerate(parts):
        if k != chosen and not (part.still or free[k]):
            continue
        first_s, last_s = seconds(*limits[k]) if free[k] else seconds(part.first, part.stop)
        if first_s - before > half:
            spans.append(Span(SpanKind.HANDLED, before, first_s))
        if k != chosen:
            spans.append(Span(SpanKind.AT_REST if part.still else SpanKind.FREE, max(first_s, before), last_s))
        before = last_s
    if end_s - before > half:
        spans.append(Span(SpanKind.HANDLED, before, end_s))
    breaks = [_break(series, a[1], b[0]) for a, b in itertools.pairwise(itertools.compress(limits, free))]
    return Partition(*seconds(*limits[chosen]), tuple(spans), tuple(breaks))


def _break(series: _Series, stop: int, start: int) -> Break:
    """Describe the break between the last window of one free oscillation and the first of the next."""
    middle = 0.5 * (stop - 1 + start)
    before = series.continued(np.arange(stop - ADJACENT, stop), middle)
    after = series.continued(np.arange(start, start + ADJACENT), middle)
    ratio = math.log(max(after[0], series.u[0, start]) / max(before[0], series.u[0, stop - 1]))
    angle = math.remainder(after[1] - before[1], 2.0 * math.pi)
    first_s, last_s = float(series.t[stop - 1]), float(series.t[start])
    # Each straight line through five windows is extrapolated from its middle: two windows to its end plus half a pause.
    away = 2.0 + middle - (stop - 1)
    u_ratio = math.sqrt(0.2 + 0.1 * away**2) * math.hypot(series.u[1, stop - 1], series.u[1, start])
    # Of touches at any moment, one in sixteen changes the phase ten times as much as the amplitude.
    alone = abs(ratio) < min(max(series.far * u_ratio, NEGLIGIBLE * abs(angle)), abs(angle))
    if start - stop >= ADJACENT:
        kind = BreakKind.RESTARTED
    else:
        kind = BreakKind.PHASE_JUMP if alone else BreakKind.TOUCHED
    return Break(kind, 0.5 * (first_s + last_s), math.expm1(ratio), angle)


def _released(series: _Series) -> Partition | None:
    """Return the record from the release on, before which the amplitude was far smaller; a free one only falls."""
    most = int(np.argmax(series.size))
    small = np.flatnonzero(series.size[:most] < SHARE * series.size[most])
    if not small.size or series.t.size - most < FEWEST_FOR_LINE:
        return None
    # The next window may contain the release.
    first, half = int(small[-1]) + 2, 0.5 * series.spacing
    begin_s, first_s = float(series.t[0]) - half, float(series.t[first]) - half
    if np.max(series.size[small]) < NEGLIGIBLE * series.size[most]:
        span = Span(SpanKind.AT_REST, begin_s, float(series.t[small[-1]]) + half)
    else:
        span = Span(SpanKind.HANDLED, begin_s, first_s)
    return Partition(first_s, math.inf, (span,))


def _faded(series: _Series, moving: int) -> Partition | None:
    """Return the record up to where its motion is lost in the noise permanently."""
    if moving < 2:
        return None
    last_s = float(series.t[moving - 1]) + series.spacing
    end_s = float(series.t[-1]) + 0.5 * series.spacing
    return Partition(-math.inf, last_s, (Span(SpanKind.AT_REST, last_s, end_s),))
