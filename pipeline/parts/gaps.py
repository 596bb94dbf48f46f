"""Gaps: where nothing was recorded for so long that the turns of the oscillation cannot be counted across."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import AnalysisError
from pipeline.notice import Refusal
from pipeline.numerics.levels import FEWEST_FOR_CURVE, FEWEST_FOR_MEDIAN, NEGLIGIBLE, SIGNIFICANT
from pipeline.numerics.regression import correlation_length, solve_weighted
from pipeline.parts.spans import Partition, Span, SpanKind
from pipeline.samples.condition import GAP, Samples
from pipeline.track import F8, Quality
from pipeline.windows.cycles import Cycles, find_cycles
from pipeline.windows.demodulate import ROUNDING, demodulate


def longest_part(samples: Samples) -> Partition | None:
    """Return the longest part without a gap across which turns cannot be counted; None if it is the whole record.

    A gap is bridged if it is not longer than the longer of the parts beside it, and if the phase that a straight line
    through the phases of one part predicts for its middle is known, at three standard uncertainties, to within a tenth
    of the half turn at which turns are miscounted, and agrees with that of the other part. A part of too few periods
    has no phase; there the other part decides alone.
    """
    t = samples.track.t[samples.used]
    stretches = _stretches(samples, t)
    if len(stretches) == 1:
        return None
    # A bob that has come to rest during the gap leaves a longer part with nothing but noise.
    order = sorted(stretches, key=lambda each: int(np.searchsorted(t, each[0]) - np.searchsorted(t, each[1])))
    every = samples.track.t
    oscillating = (each for each in order if _oscillation(samples, (every >= each[0]) & (every <= each[1])))
    part = next(oscillating, order[0])
    chosen = stretches.index(part)
    spans = [Span(SpanKind.FREE, *each) for k, each in enumerate(stretches) if k != chosen]
    spans += [Span(SpanKind.GAP, a[1], b[0]) for a, b in itertools.pairwise(stretches)]
    return Partition(*stretches[chosen], tuple(sorted(spans, key=lambda span: span.first_s)))


def _oscillation(samples: Samples, rows: NDArray[np.bool_]) -> tuple[Samples, Cycles] | None:
    """Return the record with all but some samples flagged, and its cycles; None if they show no oscillation."""
    part = replace(samples, flags=samples.flags | np.where(rows, np.uint8(0), np.uint8(Quality.OUTSIDE)))
    if np.count_nonzero(part.used) < FEWEST_FOR_CURVE or isinstance(cycles := find_cycles(part), Refusal):
        return None
    return part, cycles


def _stretches(samples: Samples, t: F8) -> list[tuple[float, float]]:
    """Split the times of the samples used at every gap that is not bridged, beginning with the longest gap."""
    whole = [(float(t[0]), float(t[-1]))]
    steps = np.diff(t)
    if not steps.size:
        return whole
    k = int(np.argmax(steps))
    gap_s, longer_s = float(steps[k]), max(float(t[k] - t[0]), float(t[-1] - t[k + 1]))
    if gap_s <= GAP / samples.track.rate_hz:
        return whole
    if gap_s <= longer_s and _continues(samples, float(t[k]), float(t[k + 1])):
        return whole
    return [*_stretches(samples, t[: k + 1]), *_stretches(samples, t[k + 1 :])]


def _phase_line(samples: Samples, rows: NDArray[np.bool_]) -> tuple[float, F8, F8] | None:
    """Fit a straight line to the phases of some samples; None if they do not show enough periods.

    It is returned as its middle, s, its level and slope there, and their covariance.
    """
    if (found := _oscillation(samples, rows)) is None:
        return None
    try:
        windows = demodulate(*found)
    except AnalysisError:
        return None
    if windows.t.size < FEWEST_FOR_MEDIAN:
        return None
    u = np.maximum(np.sqrt(windows.covariance[:, 1, 1]), ROUNDING)
    middle_s = float(np.mean(windows.t))
    line = solve_weighted(np.stack([np.ones(u.size), windows.t - middle_s], axis=1), windows.phase, u)
    widening = max(1.0, line.chi2 / (u.size - 2)) * correlation_length(line.residual / u)
    return middle_s, line.values, line.covariance * widening


def _continues(samples: Samples, last_s: float, next_s: float) -> bool:
    """Return whether the oscillation goes on across a gap with a known number of turns."""
    t, gap_s = samples.track.t, 0.5 * (last_s + next_s)
    lines = [line for rows in (t <= last_s, t >= next_s) if (line := _phase_line(samples, rows)) is not None]
    if not lines or (next_s - last_s) * max(values[1] for _, values, _ in lines) < 2.0 * math.pi:
        return True
    ahead = [(np.array([1.0, gap_s - middle_s]), values, covariance) for middle_s, values, covariance in lines]
    phases = [float(at @ values) for at, values, _ in ahead]
    u = math.sqrt(max(float(at @ covariance @ at) for at, _, covariance in ahead))
    apart = math.remainder(phases[-1] - phases[0], 2.0 * math.pi)
    return max(SIGNIFICANT * u, abs(apart)) <= NEGLIGIBLE * math.pi
