"""Clipping: crests that contradict the sinusoid through the rest of their cycle, left out by the fitted motion.

A level plateau shows in the distances alone (:mod:`condition`). One that wanders from crest to crest, rounds off, lies
at both ends or goes with the first cycles does not: it shows against the middle of the swing, which no fixed object
reaches.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.robust import mad_sigma
from pipeline.oscillation.condition import Conditioned, Cut
from pipeline.oscillation.cycles import Cycles
from pipeline.oscillation.demodulate import Demodulated
from pipeline.oscillation.windows import Windows, solve
from pipeline.track import F8, UNUSABLE, Quality

__all__ = ["find_cuts"]

MIDDLE = 0.5  # of the amplitude: no cut is sought within, and the fit begins with what lies there
CREST = 0.87  # of the amplitude: within 30 degrees of the turning point
SUSPICIOUS = 8  # samples that fall short by far at one end before an end is looked at
NOISIER = 1.15  # ratio of the windows' noise to that of neighbours from which on both ends are looked at
SIGNIFICANT = 4.0  # standard uncertainties by which a crest falls short
LEAST_CRESTS = 3
LEAST_SHARE = 0.75  # of the crests between the first and the last cut one; echoes come and go
LEAST_SLOPE = 0.35  # by how much a cut falls short, over how far the motion goes beyond its level
PLATEAU = 0.65  # the same, from which on an object is held to be fixed
BINS, LEAST_BIN = 30, 12  # of equal number of samples, and how many at least
SHARE_OFF = 0.08  # of a bin's samples beyond 3.5 standard deviations
ROUNDS = 4

Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """Every window's sinusoid: (w,) rest and amplitude, (w, l) model, residual and standard deviation of both, m."""

    rest: F8
    amplitude: F8
    model: F8
    residual: F8
    u: F8
    good: Bools


@dataclass(frozen=True, slots=True, eq=False)
class _End:
    """Where the motion is cut at one end: the level in the sense of ``sign``, m, and (w,) which windows' crests."""

    sign: float
    level: float
    crests: Bools
    slope: float


def find_cuts(conditioned: Conditioned, cycles: Cycles, demodulated: Demodulated) -> Conditioned | None:
    """Return the record with every crest flagged that is cut, or None where none shows beyond what is flagged already.

    Parameters
    ----------
    conditioned, cycles, demodulated
        Outputs of the stages of those names.

    Notes
    -----
    Every window's sinusoid is fitted to the middle of its swing. A crest is cut where its samples within thirty degrees
    of the turning point fall off the fit by more than four standard uncertainties; by single crests that is a cluster
    of echoes, by nearly all from a first to a last one it is a cut. Outward from the middle, samples of these crests
    are compared with the fit in bins of equal number; the cut begins beneath the last bin that is off in the mean or in
    more than a few samples, as smoothed ramps and plateaus that wander make it. Then the fit is repeated with all that
    lies outside. A sample is left out where the model lies beyond, whatever the sample says: what is left is not biased.
    Where a law of scale or a harmonic bends the motion, the deviation reaches into the middle or stays small beside the
    way beyond the level, and nothing is left out.
    """
    if not _suspect(conditioned, demodulated):
        return None
    flags = conditioned.flags & ~np.uint8(Quality.CLIPPED) | conditioned.track.flags
    windows = Windows.cut(replace(conditioned, flags=flags), cycles.bounds)
    decay = np.interp(windows.centre, demodulated.t, demodulated.decay)
    basis = windows.basis(np.full(decay.size, demodulated.angular_frequency), decay)
    least = max(conditioned.noise_m, 0.3 * (conditioned.quantum_m or 0.0), windows.tiny)
    usable = windows.usable > 0
    fit, sigma = _middle(windows, basis, usable, least)
    ends: list[_End] = []
    for _ in range(ROUNDS):
        before, ends = ends, [end for sign in (1.0, -1.0) if (end := _cut(fit, usable, sign, sigma)) is not None]
        if not ends or _same(before, ends, sigma):
            break
        within = usable & ~_beyond(fit, ends)
        fit = _fitted(windows, basis, within & (np.abs(fit.residual) < 5.0 * fit.u), sigma)
    if not ends:
        return None
    beyond = _beyond(fit, ends) & windows.placed
    rows = windows.rows[beyond & ((flags[windows.rows] & UNUSABLE) == 0)]
    flags[rows] |= np.uint8(Quality.CLIPPED)
    cuts = tuple(_described(end, fit, windows, conditioned, beyond) for end in ends)
    return replace(conditioned, flags=flags, plateaus_m=(), clipped_from_m=(), cuts=cuts)


def _suspect(conditioned: Conditioned, demodulated: Demodulated) -> bool:
    """Whether the windows scatter more than neighbours do, or many samples at one end fall short of their fit."""
    if conditioned.plateaus_m or demodulated.noise_m > NOISIER * conditioned.noise_m:
        return True
    rows = np.flatnonzero((demodulated.flags & ~conditioned.flags & np.uint8(Quality.FALSE_ECHO)) != 0)
    if rows.size < SUSPICIOUS:
        return False
    residual = demodulated.residual[rows]
    depth = conditioned.track.y[rows] - residual - np.median(demodulated.offset)
    amplitude = np.interp(conditioned.track.t[rows], demodulated.t, demodulated.amplitude)
    crest = np.abs(depth) > MIDDLE * amplitude
    far = crest & (depth > 0.0)
    return max(np.count_nonzero(far), np.count_nonzero(crest & ~far)) >= SUSPICIOUS


def _fitted(windows: Windows, basis: F8, chosen: Bools, sigma: float) -> _Fit:
    solution = solve(basis, chosen.astype(np.float64))
    rest, a, b = solution.coefficients.T
    part = basis[:, :3]
    variance = 1.0 + np.sum(part * (solution.inverse @ part), axis=1)
    u = sigma * np.sqrt(np.maximum(variance, 1.0))
    return _Fit(rest, np.hypot(a, b), windows.y - solution.residual, solution.residual, u, solution.good)


def _middle(windows: Windows, basis: F8, usable: Bools, least: float) -> tuple[_Fit, float]:
    """Return the sinusoids through the middle of every swing, and the noise about them, ``least`` at least, m."""
    fit, sigma, middle = _fitted(windows, basis, usable, least), np.inf, usable
    for _ in range(10):
        inside = np.abs(fit.model - fit.rest[:, None]) < MIDDLE * fit.amplitude[:, None]
        middle = usable & inside & (np.abs(fit.residual) < 5.0 * sigma)
        fit = _fitted(windows, basis, middle, least)
        inside = usable & inside & fit.good[:, None]
        if _ > 5 and inside.any():
            sigma = max(least, mad_sigma(fit.residual[inside]))
    return _fitted(windows, basis, middle, max(least, min(sigma, 1e300))), sigma


def _cut(fit: _Fit, usable: Bools, sign: float, sigma: float) -> _End | None:
    """Return where the motion is cut at one end, if it is."""
    height = sign * fit.model
    top = sign * fit.rest + fit.amplitude
    depth = height - sign * fit.rest[:, None]
    judged = usable & fit.good[:, None]
    crest = judged & (depth > CREST * fit.amplitude[:, None])
    count = crest.sum(axis=1)
    known = count >= 3
    if np.count_nonzero(known) < LEAST_CRESTS:
        return None
    short = np.full(fit.rest.size, 0.0)
    short[known] = np.nanmedian(np.where(crest, -sign * fit.residual, np.nan)[known], axis=1)
    u_model = np.sqrt(np.where(crest, np.maximum(fit.u**2 - sigma**2, 0.0), 0.0).max(axis=1))
    u_short = np.sqrt(1.6 * sigma**2 / np.maximum(count, 1) + u_model**2)
    off = known & (np.abs(short) > SIGNIFICANT * u_short)
    if np.count_nonzero(off) < LEAST_CRESTS:
        return None
    inward = 1.0 if np.median(short[off]) > 0.0 else -1.0
    off &= inward * short > 0.0
    if np.count_nonzero(off) < LEAST_CRESTS:
        return None
    outer = judged & (depth > MIDDLE * fit.amplitude[:, None]) & off[:, None]
    level = _onset(height[outer], -inward * sign * fit.residual[outer], fit.u[outer])
    if level is None:
        return None
    # A crest that reaches well beyond the level and is not off is free of what cuts the others.
    reach = 0.9 * (top - level)
    free = known & ~off & (LEAST_SLOPE * reach > 1.5 * SIGNIFICANT * u_short)
    first, last = np.flatnonzero(off)[[0, -1]]
    span = slice(int(first), int(last) + 1)
    held = np.count_nonzero(off[span])
    if held < LEAST_SHARE * (held + np.count_nonzero(free[span])):
        return None
    slope = float(np.sum(np.abs(short[off])) / max(np.sum(reach[off]), 1e-300))
    if slope < LEAST_SLOPE:
        return None
    told = np.flatnonzero(off | free)
    nearest = told[np.abs(np.arange(off.size)[:, None] - told).argmin(axis=1)]
    return _End(sign, level, off[nearest], slope * inward)


def _onset(height: F8, short: F8, u: F8) -> float | None:
    """Return the height from which on samples are off, or None where they are as far down as they were looked at."""
    order = np.argsort(height)[::-1]
    size = max(order.size // BINS, LEAST_BIN)
    bins = order.size // size
    if bins < 3:
        return None
    order = order[: bins * size].reshape(bins, size)
    scaled = short[order] / u[order]
    mean = np.clip(scaled, -6.0, 6.0).mean(axis=1)
    off = (mean > 3.0 / np.sqrt(size)) | ((scaled > 3.5).mean(axis=1) > SHARE_OFF)
    clean = np.flatnonzero(~off[:-1] & ~off[1:])
    if not clean.size or clean[0] == 0:
        return None
    return float(height[order[clean[0] - 1]].min())


def _beyond(fit: _Fit, ends: list[_End]) -> Bools:
    """(w, l): where the model lies beyond the level at which the motion is cut, or one sample from there."""
    beyond = np.zeros(fit.model.shape, np.bool_)
    for end in ends:
        beyond |= end.crests[:, None] & (end.sign * fit.model > end.level)
    wider = beyond.copy()
    wider[:, 1:] |= beyond[:, :-1]
    wider[:, :-1] |= beyond[:, 1:]
    return wider


def _same(before: list[_End], ends: list[_End], sigma: float) -> bool:
    return len(before) == len(ends) and all(
        old.sign == new.sign and abs(old.level - new.level) < 0.5 * sigma and np.array_equal(old.crests, new.crests)
        for old, new in zip(before, ends, strict=True)
    )


def _described(end: _End, fit: _Fit, windows: Windows, conditioned: Conditioned, beyond: Bools) -> Cut:
    rows = windows.rows[beyond & end.crests[:, None] & (end.sign * (fit.model - fit.rest[:, None]) > 0.0)]
    t = conditioned.track.t[rows]
    return Cut(
        "far" if end.sign > 0.0 else "near",
        end.sign * end.level + windows.level,
        rows.size,
        float(t.min()),
        float(t.max()),
        end.slope >= PLATEAU,
    )
