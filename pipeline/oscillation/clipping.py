"""Clipping: crests that contradict the sinusoid through the rest of their cycle, left out by the fitted motion.

A level plateau shows in the distances alone (:mod:`condition`). One that wanders from crest to crest, rounds off, lies
at both ends or goes with the first cycles does not: it shows against the middle of the swing, which no fixed object
reaches.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.robust import mad_sigma
from pipeline.oscillation.condition import Conditioned, Cut
from pipeline.oscillation.cycles import Cycles
from pipeline.oscillation.demodulate import Demodulated
from pipeline.oscillation.windows import Solution, Windows, refit, solve
from pipeline.track import F8, UNUSABLE, Quality

__all__ = ["find_cuts"]

INNER = 0.35  # of the amplitude: from here on samples are compared with the fit
LOWEST = 0.42  # of the amplitude: what begins further in is the shape of the motion, and no cut
MIDDLE = 0.5  # of the amplitude: the fit begins with what lies within
CREST = 0.87  # of the amplitude: within 30 degrees of the turning point
SUSPICIOUS = 8  # false echoes at one end from which on both ends are looked at
NOISIER = 1.15  # ratio of the windows' noise to that of neighbours from which on both ends are looked at
OFF = 1.5  # standard deviations of neighbours' noise by which a crest is off the windows' own fit
NEARLY = 0.6  # of the crests between the first and the last one off, from which on the middle of the swing is looked at
SIGNIFICANT = 4.0  # standard uncertainties by which a crest falls short
LEAST_CRESTS = 3
LEAST_SHARE = 0.75  # of the crests between the first and the last cut one; echoes come and go
LEAST_SLOPE = 0.35  # by how much a crest is off, over how far the motion goes beyond the level
LEAST_JUMP = 0.7  # how far off samples are in the lowest third beyond the level, over how far the crests are
FIXED = 0.3  # motion of the distances over that of the bob beyond the level, up to which what cuts is held to be fixed
LEAST_BEYOND = 6  # samples beyond the level in a crest, for their halves to be compared
BINS, LEAST_BIN = 30, 12  # of equal number of samples, and how many at least
SHARE_OFF = 0.08  # of a bin's samples beyond 3.5 standard deviations
FAR_OFF = 5.0  # standard deviations beyond which a sample is a false echo
SETTLING = 10  # fits until that through the middle of the swing is free of what the crests made of the first
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
    lies outside. A sample is left out where the model lies beyond, whatever the sample says: that brings no bias.
    Where a law of scale or a harmonic bends the motion, the deviation reaches into the middle or stays small beside the
    way beyond the level, and nothing is left out.
    """
    if not _suspect(conditioned, demodulated) or not _off_together(conditioned, cycles, demodulated):
        return None
    flags = conditioned.flags.copy()
    seen = slice(int(cycles.bounds[0]), int(cycles.bounds[-1]))
    flags[seen] = flags[seen] & ~np.uint8(Quality.CLIPPED) | conditioned.track.flags[seen]
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
        within &= np.abs(fit.residual) < FAR_OFF * fit.u
        fit = _fitted(windows, basis, solve(basis, within.astype(np.float64)), sigma)
    if not ends:
        return None
    cuts = []
    for end in ends:
        beyond = _beyond(fit, [end]) & usable
        cuts.append(_described(end, fit, windows, conditioned, beyond))
        flags[windows.rows[beyond]] |= np.uint8(Quality.CLIPPED if cuts[-1].fixed else Quality.FALSE_ECHO)
    plateaus = tuple(cut.level_m for cut in cuts if cut.fixed)
    return replace(conditioned, flags=flags, plateaus_m=plateaus, clipped_from_m=(), cuts=tuple(cuts))


def _suspect(conditioned: Conditioned, demodulated: Demodulated) -> bool:
    """Whether the windows scatter more than neighbours do, or many samples at one end are false echoes."""
    if demodulated.noise_m > NOISIER * conditioned.noise_m:
        return True
    rows = np.flatnonzero((demodulated.flags & ~conditioned.flags & np.uint8(Quality.FALSE_ECHO)) != 0)
    if rows.size < SUSPICIOUS:
        return False
    residual = demodulated.residual[rows]
    depth = conditioned.track.y[rows] - residual - np.median(demodulated.offset)
    amplitude = np.interp(conditioned.track.t[rows], demodulated.t, demodulated.amplitude)
    crest = np.abs(depth) > MIDDLE * amplitude
    far = crest & (depth > 0.0)
    return bool(max(np.count_nonzero(far), np.count_nonzero(crest & ~far)) >= SUSPICIOUS)


def _off_together(conditioned: Conditioned, cycles: Cycles, demodulated: Demodulated) -> bool:
    """Whether nearly all crests between a first and a last one are off the windows' own fits, to the same side.

    These fits went through the crests too and still leave them off by a third and more of what they fall short by.
    Echoes and sideways motions, which leave less than half of the crests off, end here in a twentieth of the time.
    """
    rows = slice(int(cycles.bounds[0]), int(cycles.bounds[-1]))
    lengths = np.diff(cycles.bounds)
    middle = conditioned.track.t[(cycles.bounds[:-1] + cycles.bounds[1:] - 1) // 2]
    size, offset = (
        np.repeat(np.interp(middle, demodulated.t, x), lengths) for x in (demodulated.amplitude, demodulated.offset)
    )
    window, residual = np.repeat(np.arange(lengths.size), lengths), demodulated.residual[rows]
    depth = conditioned.track.y[rows] - residual - offset
    bound = OFF * min(conditioned.noise_m, demodulated.noise_m)
    for crest in (depth > CREST * size, depth < -CREST * size):
        crest &= (conditioned.track.flags[rows] & UNUSABLE) == 0
        at, left = window[crest], residual[crest]
        told = np.bincount(at, minlength=lengths.size)
        for sign in (1.0, -1.0):
            off = 2 * np.bincount(at[sign * left > bound], minlength=lengths.size) >= told
            first, last = np.flatnonzero(off)[[0, -1]].tolist() if off.any() else (0, 0)
            if last - first + 1 >= LEAST_CRESTS and np.mean(off[first : last + 1]) > NEARLY:
                return True
    return False


def _fitted(windows: Windows, basis: F8, solution: Solution, sigma: float) -> _Fit:
    rest, a, b = solution.coefficients.T
    part = basis[:, :3]
    variance = 1.0 + np.sum(part * (solution.inverse @ part), axis=1)
    u = sigma * np.sqrt(np.maximum(variance, 1.0))
    return _Fit(rest, np.hypot(a, b), windows.y - solution.residual, solution.residual, u, solution.good)


def _middle(windows: Windows, basis: F8, usable: Bools, least: float) -> tuple[_Fit, float]:
    """Return the sinusoids through the middle of every swing, and the noise about them, ``least`` at least, m."""
    sigma = np.inf
    solution = solve(basis, usable.astype(np.float64))
    for step in range(SETTLING):
        before = sigma
        rest, a, b = solution.coefficients.T
        depth = windows.y - solution.residual - rest[:, None]
        inside = usable & (np.abs(depth) < (MIDDLE * np.hypot(a, b))[:, None])
        refit(basis, solution, (inside & (np.abs(solution.residual) < FAR_OFF * sigma)).astype(np.float64))
        inside &= solution.good[:, None]
        # False echoes are let go of once the fit has come away from the crests.
        if step > SETTLING // 2 and inside.any():
            sigma = max(least, mad_sigma(solution.residual[inside]))
    return _fitted(windows, basis, solution, min(before, float(np.ptp(windows.y)))), sigma


def _shortfalls(fit: _Fit, crest: Bools, sign: float, sigma: float) -> tuple[F8, F8, Bools]:
    """(w,): by how much each window's crest falls short of the fit, its standard uncertainty, m, and where known."""
    count = crest.sum(axis=1)
    known = count >= 3
    short = np.zeros(known.size)
    short[known] = _median_of_rows(-sign * fit.residual[known], crest[known])
    u_model = np.sqrt(np.where(crest, np.maximum(fit.u**2 - sigma**2, 0.0), 0.0).max(axis=1))
    # A median's variance is 1.6 times a mean's.
    return short, np.sqrt(1.6 * sigma**2 / np.maximum(count, 1) + u_model**2), known


def _cut(fit: _Fit, usable: Bools, sign: float, sigma: float) -> _End | None:
    """Return where the motion is cut at one end, if it is."""
    height, top = sign * fit.model, sign * fit.rest + fit.amplitude
    depth = height - sign * fit.rest[:, None]
    judged = usable & fit.good[:, None]
    short, u_short, known = _shortfalls(fit, judged & (depth > CREST * fit.amplitude[:, None]), sign, sigma)
    off = known & (np.abs(short) > SIGNIFICANT * u_short)
    inward = 1.0 if np.sum(np.sign(short[off])) >= 0.0 else -1.0
    off &= inward * short > 0.0
    if np.count_nonzero(off) < LEAST_CRESTS:
        return None
    outer = off[:, None] & judged & (depth > INNER * fit.amplitude[:, None])
    level = _onset(height[outer], -inward * sign * fit.residual[outer], fit.u[outer])
    if level is None or np.median((level - sign * fit.rest[off]) / fit.amplitude[off]) < LOWEST:
        return None
    # A crest that reaches well beyond the level and is not off is free of what cuts the others.
    reach = 0.9 * (top - level)
    free = known & ~off & (LEAST_SLOPE * reach > 1.5 * SIGNIFICANT * u_short)
    first, last = np.flatnonzero(off)[[0, -1]].tolist()
    held, others = (np.count_nonzero(these[first : last + 1]) for these in (off, free))
    if held < LEAST_SHARE * (held + others):
        return None
    # What sets in gradually and leads outward is the shape of the motion.
    size = float(np.median(np.abs(short[off])))
    lowest = off[:, None] & judged & (height > level) & (height < level + (top - level)[:, None] / 3.0)
    sudden = np.any(lowest) and abs(float(np.median(fit.residual[lowest]))) >= LEAST_JUMP * size
    if not sudden and (inward < 0.0 or size < LEAST_SLOPE * float(np.median(reach[off]))):
        return None
    told = np.flatnonzero(off | free)
    return _End(sign, level, np.interp(np.arange(off.size), told, off[told].astype(np.float64)) >= 0.5)


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
    t = conditioned.track.t[windows.rows[beyond]]
    place: Literal["far", "near"] = "far" if end.sign > 0.0 else "near"
    start = float(end.sign * end.level + windows.level)
    height, y = end.sign * fit.model[beyond], (fit.model + fit.residual)[beyond]
    level = float(np.median(y[height >= np.median(height)])) + windows.level
    return Cut(place, start, level, int(t.size), float(t.min()), float(t.max()), _stands_still(end, fit, beyond))


def _stands_still(end: _End, fit: _Fit, beyond: Bools) -> bool:
    """Whether the distances hardly move from the lower half of what lies beyond the level in a crest to the upper."""
    told = beyond.sum(axis=1) >= LEAST_BEYOND
    height, y = end.sign * fit.model[told], end.sign * (fit.model + fit.residual)[told]
    height[~beyond[told]] = np.nan
    upper = height > np.nanmedian(height, axis=1)[:, None]
    lower = ~upper & np.isfinite(height)
    way, path = (_median_of_rows(x, upper) - _median_of_rows(x, lower) for x in (y, height))
    return abs(float(way.sum())) <= FIXED * float(path.sum())


def _median_of_rows(values: F8, chosen: Bools) -> F8:
    """(w,): the median of the values chosen in each row, one at least."""
    ordered = np.sort(np.where(chosen, values, np.inf), axis=1)
    rows, count = np.arange(len(ordered)), chosen.sum(axis=1)
    return np.asarray(0.5 * (ordered[rows, (count - 1) // 2] + ordered[rows, count // 2]))
