"""Condition: flag every sample that a fit must not take at face value, without dropping any."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import AnalysisError
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.levels import (
    FEWEST_FOR_CURVE,
    FEWEST_FOR_MEDIAN,
    LARGEST,
    NEGLIGIBLE,
    SIGNIFICANT,
    normal_quantile,
)
from pipeline.numerics.robust import mad_sigma
from pipeline.track import F8, U8, UNUSABLE, Quality, Track

# Standard deviation of y[i-2] - 4 y[i-1] + 6 y[i] - 4 y[i+1] + y[i+2] for unit white noise: 1 + 16 + 36 + 16 + 1.
FOURTH_DIFFERENCE_GAIN = math.sqrt(math.comb(8, 4))
# Ratio of step to noise above which the step is coarse: rounding makes 56 % of the variance. It is 3.5 for rounding
# alone. Readings with a ratio of 2.5 still have correlations, measured by `python -m tests.golden --only kamjha`.
COARSE = 2.6
# Relative standard uncertainty of the noise from fourth differences of n samples, times the root of n: measured on 2000
# records of 8000 normal deviates. That of a standard deviation is 0.71.
U_OF_DIFFERENCES = 1.63
# Distance from a plateau, in standard deviations, within which noise decides whether a sample is clipped: beyond it,
# the probability is 5e-4.
CREST_SIGMAS = 3.5
# Samples over which a local curvature is estimated; the probability on either side of its quantile is known to 3 %.
CURVATURE_BLOCK = 256
# Fraction of the largest value below which differences are rounding errors of one value. It is chosen between those of
# numbers in double and in single precision, 1e-16 and 6e-8.
ONE_VALUE = 1e-9
# Distance of a false echo from the median of the five samples around it, beyond what curvature explains, in standard
# deviations of the noise: a normal deviate lies beyond it with a probability of 1e-15.
SPIKE_SIGMAS = 8.0
# Least ratio of the number of samples in a plateau to that in the band of equal width beneath it. For an unclipped
# crest the ratio is 1 / (sqrt 2 - 1) = 2.4; it is below 3.8 in 90 % of the recordings of `python -m tests.golden`.
CONTRAST = 5.0
# Time between two samples, in sample intervals, above which they are no neighbours: the length of the filter of spikes.
# If every second sample is missing by chance, a longer gap has a probability of 3 %.
GAP = 5.0


@dataclass(frozen=True, slots=True)
class Clipping:
    """One end of the motion at which a fixed object or a lost target clips it, as its sinusoid shows."""

    end: Literal["far", "near"]
    beyond: float  # distance beyond which samples are left out, m
    level: float  # median of the outer half of the distances left out, m
    samples: int  # number of samples left out
    # first_s, last_s: times of the first and the last sample left out, s.
    first_s: float
    last_s: float


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """A track in which every sample has been judged."""

    track: Track  # the track as it was given
    flags: U8  # (n,) the track's own flags and those found here
    # Standard deviation of the white noise from fourth differences, m; independent of any model of the motion.
    noise: float
    plateaus: tuple[float, ...]  # distances at which the record is clipped
    # Resolution of the distances: the track's, or a coarser one that the distances themselves show.
    quantum: float | None
    clipped_from: tuple[float, ...] = ()  # for each plateau, the distance beyond which samples were flagged
    clippings: tuple[Clipping, ...] = ()  # found by the sinusoid (pipeline.parts.clipping), which replace the plateaus

    @property
    def used(self) -> NDArray[np.bool_]:
        """(n,) bool: True for samples without any flag that excludes them."""
        mask: NDArray[np.bool_] = (self.flags & UNUSABLE) == 0
        return mask

    @property
    def noise_estimate(self) -> Estimate:
        """The noise with its standard uncertainty."""
        u = U_OF_DIFFERENCES * self.noise / math.sqrt(max(int(np.count_nonzero(self.used)), 1))
        return Estimate(self.noise, u, self.track.unit)

    @property
    def noise_of_reading(self) -> float:
        """The noise of one sample, at least that of rounding to the resolution, in the record's unit."""
        return max(self.noise, (self.quantum or 0.0) / math.sqrt(12.0))

    def less(self, taken: F8) -> Samples:
        """Return the record with values (n,) subtracted from its distances; flags and times are kept."""
        return replace(self, track=replace(self.track, y=self.track.y - taken))

    def near_plateau(self, model: F8, noise: float) -> NDArray[np.bool_]:
        """Return where a model is so close to a plateau that noise decides whether a sample is clipped.

        The model selects the samples to leave out there, not their own noise, so the remaining samples are not biased.
        """
        near = np.zeros(model.shape, np.bool_)
        middle = float(np.median(model)) if self.clipped_from else 0.0
        for bottom in self.clipped_from:
            sign = 1.0 if bottom > middle else -1.0
            near |= sign * model > sign * bottom - CREST_SIGMAS * noise
        return near


def condition(track: Track) -> Samples:
    """Flag missing samples, duplicate and backward times, isolated false echoes and clipped plateaus.

    Noise is estimated from fourth differences. A motion of amplitude A and angular frequency :math:`\\omega`, sampled
    every :math:`h`, contributes only :math:`A (\\omega h)^4` to them. The median of their absolute values is taken, so
    false echoes have no effect.

    >>> import numpy as np
    >>> t = np.arange(1000) / 100
    >>> y = 0.2 + 0.05 * np.cos(8.3 * t)
    >>> y[500] = 1.4
    >>> found = condition(Track.from_arrays(t, y))
    >>> int(found.flags[500]), int(np.count_nonzero(found.flags))
    (2, 1)
    """
    flags = track.flags.copy()
    measured = np.abs(track.y) < LARGEST  # and not NaN
    flags[~measured] |= np.uint8(Quality.MISSING)
    # Where the reader has flagged one of two interchanged rows, its decision is kept.
    judged = (flags & np.uint8(Quality.DUPLICATE_TIME | Quality.NON_MONOTONIC_TIME)) != 0
    flags |= _time_flags(np.where(judged, np.nan, track.t), judged)
    clean = (flags & UNUSABLE) == 0
    if np.count_nonzero(clean) < FEWEST_FOR_CURVE:
        flagged = {flag: int(np.count_nonzero(flags & np.uint8(flag))) for flag in Quality if flag & UNUSABLE}
        why = ", ".join(f"{count} {flag.name.lower()}" for flag, count in flagged.items() if count and flag.name)
        raise AnalysisError(
            f"an analysis needs eight usable samples at least, got {np.count_nonzero(clean)} of {len(track)}"
            f"{f' (flagged: {why})' if why else ''}",
            "record longer, or see to those flagged",
        )
    y, rows = track.y[clean], np.flatnonzero(clean)
    half_step = 0.5 * (track.quantum_m or 0.0)
    spikes = _spikes(y, half_step, SPIKE_SIGMAS, _edges(track.t[clean], track.rate_hz))
    flags[rows[spikes]] |= np.uint8(Quality.FALSE_ECHO)
    y_kept, rows = y[~spikes], rows[~spikes]
    noise = fourth_difference_noise(y_kept)
    plateaus: list[float] = []
    bottoms: list[float] = []
    ordered = np.sort(y_kept)
    found = [
        (sign, *_plateau(sign * y_kept, increasing, max(noise, half_step)))
        for sign, increasing in ((1.0, ordered), (-1.0, -ordered[::-1]))
    ]
    # A record that lies mostly on plateaus is a step or a bob at rest, not a clipped motion.
    if sum(members.size for _, _, _, members in found) <= 0.6 * y_kept.size:
        for sign, level, bottom, members in found:
            if members.size:
                plateaus.append(sign * level)
                bottoms.append(sign * bottom)
                flags[rows[members]] |= np.uint8(Quality.CLIPPED)
    quantum = coarsest_step(ordered, track.quantum_m)
    return Samples(track, flags, noise, tuple(plateaus), quantum, tuple(bottoms))


def coarsest_step(ordered: F8, stated: float | None) -> float | None:
    """Return the smallest step between values that repeat; files print more digits than sensors resolve."""
    steps = np.diff(ordered)
    apart = steps > ONE_VALUE * max(-float(ordered[0]), float(ordered[-1]), 0.0)
    if not 0 < np.count_nonzero(apart) <= 0.5 * ordered.size:
        return stated
    least = float(steps[apart].min())
    # Values in steps are whole steps apart; those of a computed motion that repeats itself are not.
    near = steps[apart & (steps < 50.0 * least)] / least
    if np.mean(np.abs(near - np.rint(near)) > NEGLIGIBLE) > NEGLIGIBLE:
        return stated
    return least if stated is None or least > 1.5 * stated else stated


def fourth_difference_noise(y: F8) -> float:
    """Return the standard deviation of the white noise on a smooth motion.

    :math:`\\hat\\sigma = 1.4826\\,\\mathrm{median}|\\Delta^4 y| / \\sqrt{70}`.
    """
    if y.size < 5:
        return 0.0
    return mad_sigma(np.diff(y, 4)) / FOURTH_DIFFERENCE_GAIN


def _time_flags(t: F8, judged: NDArray[np.bool_]) -> U8:
    """Flag times that repeat or precede the latest time so far, except those judged already."""
    flags = np.zeros(t.size, np.uint8)
    if np.all(np.diff(t) > 0.0):
        return flags
    finite = np.isfinite(t)
    latest = np.maximum.accumulate(np.where(finite, t, -np.inf))
    before = np.concatenate([[-np.inf], latest[:-1]])
    flags[finite & (t == before)] = Quality.DUPLICATE_TIME
    flags[(~finite & ~judged) | (t < before)] = Quality.NON_MONOTONIC_TIME
    return flags


def _least_noise(second: F8, rounding: float) -> tuple[float, bool]:
    """Estimate noise from the smallest fourth differences, and say whether fewer than a quarter of them are clean.

    There must be at least three second differences. For values in coarse steps, many are 0 except for rounding.

    If a fifth of the samples are spikes, a third of the fourth differences are clean; with two fifths, a twelfth.
    """
    size = np.abs(np.diff(second, 2))
    few, many = size.size // 20, size.size // 4
    ordered = np.partition(size, many)
    ordered[:many].partition(few)  # the rest need not be partitioned again
    quarter = float(ordered[many]) / (normal_quantile(0.25) * FOURTH_DIFFERENCE_GAIN)
    twentieth = float(ordered[few]) / (normal_quantile(0.05) * FOURTH_DIFFERENCE_GAIN)
    flooded = rounding < twentieth < 0.25 * quarter
    return (twentieth if flooded else quarter), flooded


def _edges(t: F8, rate_hz: float) -> list[int]:
    """Return the indices between which samples follow each other without a gap: neighbours across one are none."""
    return [0, *(np.flatnonzero(np.diff(t) > GAP / rate_hz) + 1).tolist(), t.size]


def _spikes(y: F8, half_step: float, sigmas: float, edges: list[int]) -> NDArray[np.bool_]:
    """Return which samples deviate from the median of five around them by more than noise and curvature explain."""
    if y.size < FEWEST_FOR_CURVE:
        return np.zeros(y.size, np.bool_)
    second = np.diff(y, 2)
    rounding = 1e-12 * float(np.abs(y).max())
    noise, flooded = _least_noise(second, rounding)
    if noise <= rounding:  # most samples equal their neighbours: single ones one step off are no spikes
        half_step = 0.5 * (coarsest_step(np.sort(y), 2.0 * half_step) or 0.0)
    # Effect of curvature alone: a quantile of the second differences that spikes on a fifth of the samples leave
    # unchanged. For a cosine, the 0.15-quantile of the second differences is 0.40 times the 0.4-quantile.
    share, gain = (0.15, 2.5) if flooded else (0.4, 1.0)
    rank = int(share * second.size)
    least = sigmas * max(noise, half_step)
    spikes = _beyond(y, least + 5.0 * gain * float(np.partition(np.abs(second), rank)[rank]), edges)
    if np.count_nonzero(spikes) > 0.05 * y.size:
        # Where the bob has nearly come to rest, the curvature is less than at the start: take each block by itself.
        blocks = second[: second.size // CURVATURE_BLOCK * CURVATURE_BLOCK].reshape(-1, CURVATURE_BLOCK)
        if blocks.size and np.count_nonzero(
            local := _beyond(y, least + 5.0 * gain * _curvature(blocks, share, y.size), edges)
        ) < 0.5 * np.count_nonzero(spikes):
            return local
        # So many spikes also come in runs, which a median of five follows; but few of them lie within the motion.
        middle = float(np.median(y[~spikes]))
        reach = SIGNIFICANT * mad_sigma(y[~spikes] - middle)
        spikes |= np.abs(y - middle) > reach
    return spikes


def _curvature(blocks: F8, share: float, size: int) -> F8:
    """Return (size,): a quantile of the second differences (b, k) in each sample's block."""
    rank = int(share * blocks.shape[1])
    each = np.partition(np.abs(blocks), rank, axis=1)[:, rank]
    return np.asarray(each[np.minimum(np.arange(size) // blocks.shape[1], each.size - 1)])


def _beyond(y: F8, bound: float | F8, edges: list[int]) -> NDArray[np.bool_]:
    """Return which samples deviate from the median of five around them by more than a bound."""
    spikes = np.zeros(y.size, np.bool_)
    smooth = y
    for _ in range(4):
        away = np.concatenate([_off_median(smooth[a:b]) for a, b in itertools.pairwise(edges)])
        found = np.flatnonzero(away > bound)
        if not found.size:
            break
        # On a slope a spike shifts its neighbours' medians by a step: remove the worst and search again.
        near = np.clip(found[:, None] + np.arange(-2, 3), 0, y.size - 1)
        worst = found[away[found] >= away[near].max(axis=1)]
        spikes[worst] = True
        kept = np.flatnonzero(~spikes)
        if kept.size < FEWEST_FOR_CURVE:
            break
        smooth = y.copy()
        smooth[spikes] = np.interp(np.flatnonzero(spikes), kept, y[kept])
    return spikes


def _off_median(y: F8) -> F8:
    if y.size < 5:
        return np.zeros(y.size)
    # Both ends are extended by point reflection, which continues a slope.
    first, last = _end(y[:5]), _end(y[:-6:-1])
    padded = np.concatenate([2.0 * first - y[2:0:-1], y, 2.0 * last - y[-2:-4:-1]])
    return np.abs(y - _median_of_five(*(padded[i : i + y.size] for i in range(5))))


def _end(y: F8) -> float:
    """Return the median of the first of five samples and two linear extrapolations to it."""
    first, second, third, fifth = float(y[0]), float(y[1]), float(y[2]), float(y[4])
    return sorted((first, 2.0 * second - third, 2.0 * third - fifth))[1]


def _median_of_five(a: F8, b: F8, c: F8, d: F8, e: F8) -> F8:
    """Return the elementwise median of five arrays, computed only from minima and maxima.

    It takes 0.15 ms for 12,000 samples; scipy.ndimage's filter takes 0.3 ms plus 0.2 s to import, numpy's median
    1.4 ms.
    """
    low = np.maximum(np.minimum(a, b), np.minimum(c, d))
    high = np.minimum(np.maximum(a, b), np.maximum(c, d))
    return np.maximum(np.minimum(low, high), np.minimum(np.maximum(low, high), e))


def _clipped_often(y: F8, band: NDArray[np.bool_], low: float) -> bool:
    """Return whether the motion enters a band from below ``low`` at least twice, for a few samples each time.

    A bob that settles there enters once, and a hand that holds it there makes one stay longer than all others together.
    """
    state = np.where(band, 1, np.where(y < low, -1, 0))
    inside = state[state != 0] > 0
    visit = np.cumsum(np.concatenate([inside[:1], inside[1:] & ~inside[:-1]]))
    stays = np.bincount(visit[inside])[1:]
    return bool(stays.size >= 2 and stays.max() <= 0.5 * stays.sum())


def _plateau(y: F8, ordered: F8, noise: float) -> tuple[float, float, NDArray[np.int64]]:
    """Find a clipped plateau at the upper end of ``y``; ``ordered`` contains its values in increasing order.

    A clipped record has many samples in a band a few sigma wide, with almost none above it and few beneath. For an
    unclipped crest, the number of samples grows as the square root of the depth below the crest.
    """
    none = np.empty(0, np.int64)
    low, high = ordered[0], ordered[-1]
    if (level := _saturated(y, ordered)) is not None:
        return level, level, np.flatnonzero(y >= level)
    width = 2.0 * SIGNIFICANT * noise
    if high - low < 6.0 * width or width == 0.0:
        return 0.0, 0.0, none
    first = int(np.searchsorted(ordered, low + 0.6 * (high - low)))
    upper = ordered[first:]
    few = math.ceil(max(0.02 * y.size, FEWEST_FOR_CURVE))
    # Bands that begin at these indices contain enough samples.
    starts = np.flatnonzero(upper[few - 1 :] <= upper[: max(upper.size - few + 1, 0)] + width)
    if not starts.size:
        return 0.0, 0.0, none
    counts = np.searchsorted(upper, upper[starts] + width, side="right") - starts
    fullest = int(np.argmax(counts))
    start, inside = int(starts[fullest]), int(counts[fullest])
    bottom = upper[start]
    above = upper.size - start - inside
    beneath = first + start - int(np.searchsorted(ordered, bottom - width))
    if above > NEGLIGIBLE * inside or inside < CONTRAST * (beneath + 1):
        return 0.0, 0.0, none
    band = (y >= bottom) & (y <= bottom + width)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], band.astype(np.int8), [0]])))
    if np.median(edges[1::2] - edges[::2]) < FEWEST_FOR_MEDIAN or not _clipped_often(y, band, bottom - 3.0 * width):
        return 0.0, 0.0, none
    # Samples in heavy tails of the noise lie above the band but still belong to the plateau.
    members = np.flatnonzero(y >= bottom)
    return float(np.median(y[band])), float(bottom), members


def _saturated(y: F8, ordered: F8) -> float | None:
    """Return the value at which a sensor clips its noisy signal at the top, or None where it does not."""
    few = max(int(0.02 * y.size), FEWEST_FOR_CURVE)
    level = float(ordered[-max(few // 2, 1)])
    first, last = np.searchsorted(ordered, level), np.searchsorted(ordered, level, side="right")
    inside = int(last - first)
    if inside < few or ordered.size - last > NEGLIGIBLE * inside or first == 0:
        return None
    next_lower = ordered[first - 1]
    beneath = int(first - np.searchsorted(ordered, next_lower))
    margin = 0.05 * (level - float(ordered[0]))
    if inside < CONTRAST * (beneath + 1) or not _clipped_often(y, y >= level, level - margin):
        return None
    return level
