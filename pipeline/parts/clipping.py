"""Clipping: crests cut off by a fixed object or a lost target, found by comparison with the middle of the swing.

A level plateau shows in the distances alone (:mod:`pipeline.samples.condition`). A plateau that changes from crest to
crest, lies at both ends or ends after the first cycles does not; it shows in comparison with the middle of the swing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pipeline.numerics.levels import FALSE_ALARM, FEWEST_FOR_MEDIAN, LIMIT, OUTLIER, ROUNDS, normal_quantile
from pipeline.numerics.robust import mad_sigma
from pipeline.samples.condition import Clipping, Samples
from pipeline.track import F8, Bools, Quality
from pipeline.windows.demodulate import ROUNDING, Windows
from pipeline.windows.sinusoids import WindowSamples, refit, solve

# Number of heights tried for the level, from the middle of the swing to its top. With 80, amplitudes of clipped records
# move by up to 0.05 u, as measured by `python -m tests.trials.troubles --only clipped`.
HEIGHTS = 40

# Fraction of the amplitude within which the motion is never clipped, so that the sinusoid can be fitted: a sample lies
# there with a probability of 1/3.
MIDDLE = 0.5
# Fraction of the amplitude beyond which the crest lies: within 30 degrees of the turning point.
CREST = math.cos(math.pi / 6.0)


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """The sinusoids of all windows.

    ``rest`` and ``amplitude`` (w,) are in m. ``model`` and ``residual`` (w, l) are in m; ``u`` (w, l) is the model's
    uncertainty over that of a sample. ``judged`` (w, l) is True for samples that may be judged.
    """

    rest: F8
    amplitude: F8
    model: F8
    residual: F8
    u: F8
    judged: Bools

    def height(self, sign: float) -> F8:
        """Return (w, l): the model's displacement towards an end, over its amplitude."""
        return np.asarray(sign * (self.model - self.rest[:, None]) / self.amplitude[:, None])


@dataclass(frozen=True, slots=True, eq=False)
class _End:
    """One end at which the crests of the first windows are clipped beyond a level: distance times the end's sign, m."""

    sign: float
    level: float
    windows: int


def find_clipping(samples: Samples, windows: Windows) -> Samples | None:
    """Return the record with every clipped crest flagged, or None if none shows beyond those flagged already.

    Every window's sinusoid is fitted to the middle of its swing. Let :math:`z_j` be the shortfall of the median of
    crest j in standard uncertainties. Crests 1 to n are clipped if n maximises :math:`\\sum_{j \\le n} z_j/\\sqrt n`
    and this exceeds what noise reaches at any n with probability :data:`FALSE_ALARM` (Bonferroni's bound). The first
    crests are taken because a bob with decaying amplitude reaches a fixed object at first and later no longer.

    A fixed object removes the motion beyond its level l, so the shortfall is :math:`\\max(0, h - l)` at height h. The
    level l minimises the residual, which must be less than that of :math:`c_2 h^2 + c_3 h^3`. The latter describes a
    non-linear scale or a motion that is not sinusoidal. Samples are left out where the model lies beyond the limit that
    nineteen in twenty samples on the plateau exceed, with one more sample on either side. The model selects them, not
    their own values, so this causes no bias.
    """
    # A record whose crests are flat may show no noise at all.
    rounding = ROUNDING * float(np.max(np.abs(windows.amplitude)))
    least_noise = max(samples.noise_of_reading, rounding)
    unexplained = _of_windows(WindowSamples.sliced(samples, windows.cycles.bounds), windows)
    if not any(_clipped_windows(unexplained, sign, least_noise) for sign in (1.0, -1.0)):
        return None
    flags = samples.flags.copy()
    seen = slice(int(windows.cycles.bounds[0]), int(windows.cycles.bounds[-1]))
    flags[seen] = flags[seen] & ~np.uint8(Quality.CLIPPED) | samples.track.flags[seen]
    slices = WindowSamples.sliced(replace(samples, flags=flags), windows.cycles.bounds)
    least = max(least_noise, slices.tiny)
    whole = _of_windows(slices, windows)
    decay = np.interp(slices.centre, windows.t, windows.decay)
    basis = slices.basis(np.full(decay.size, windows.angular_frequency), decay)
    inside = np.abs(whole.height(1.0)) < MIDDLE
    ends: list[_End] = []
    for step in range(2 * ROUNDS):
        fit, sigma = _fitted(slices, basis, inside, least)
        inside = np.abs(fit.height(1.0)) < MIDDLE
        if step < ROUNDS:  # the clipped crests still affect the middle of the swing
            continue
        ends = [end for sign in (1.0, -1.0) if (end := _end(fit, sign, sigma)) is not None]
        if not ends:
            return None
        inside = ~_beyond(fit, ends)
    clippings = []
    for end in ends:
        beyond = _beyond(fit, [end]) & fit.judged
        rows, height = slices.rows[beyond], end.sign * fit.model[beyond]
        t, y = samples.track.t[rows], (fit.model + fit.residual)[beyond]
        level = float(np.median(y[height >= np.median(height)])) + slices.level
        beyond_level = float(end.sign * end.level + slices.level)
        which: Literal["far", "near"] = "far" if end.sign > 0.0 else "near"
        clippings.append(Clipping(which, beyond_level, level, int(t.size), float(t.min()), float(t.max())))
        flags[rows] |= np.uint8(Quality.CLIPPED)
    levels = tuple(each.level for each in clippings)
    return replace(samples, flags=flags, plateaus=levels, clipped_from=(), clippings=tuple(clippings))


def _of_windows(slices: WindowSamples, windows: Windows) -> _Fit:
    """Return the fits that include the crests; their residuals still show a third of the shortfall."""
    residual = np.nan_to_num(windows.residual[slices.rows])
    rest, amplitude = (np.interp(slices.centre, windows.t, x) for x in (windows.offset, np.abs(windows.amplitude)))
    model = slices.y - residual
    return _Fit(rest - slices.level, amplitude, model, residual, np.zeros_like(model), slices.usable > 0)


def _fitted(slices: WindowSamples, basis: F8, inside: Bools, least: float) -> tuple[_Fit, float]:
    """Fit every window's sinusoid to selected samples without false echoes; return it and the noise, m."""
    usable = slices.usable > 0
    solution = solve(basis, (inside & usable).astype(np.float64))
    middle = solution.residual[inside & usable & solution.good[:, None]]
    sigma = max(least, mad_sigma(middle)) if middle.size else least
    near = inside & usable & (np.abs(solution.residual) < OUTLIER * sigma)
    solution = refit(basis, solution, near.astype(np.float64))
    rest, a, b = solution.coefficients.T
    part = basis[:, :3]
    u = np.sqrt(np.maximum(np.sum(part * (solution.inverse @ part), axis=1), 0.0))
    size = np.maximum(np.hypot(a, b), slices.tiny)
    judged = usable & solution.good[:, None]
    return _Fit(rest, size, slices.y - solution.residual, solution.residual, u, judged), sigma


def _clipped_windows(fit: _Fit, sign: float, sigma: float) -> int:
    """Return the number of first windows whose crests are clipped; 0 if noise can explain the shortfall."""
    crest = fit.judged & (fit.height(sign) > CREST)
    count = crest.sum(axis=1)
    rows = np.flatnonzero(count >= FEWEST_FOR_MEDIAN)
    if rows.size < FEWEST_FOR_MEDIAN:
        return 0
    short = _median_of_rows(-sign * fit.residual[rows], crest[rows])
    u_model = np.max(np.where(crest[rows], fit.u[rows], 0.0), axis=1)
    z = short / (sigma * np.sqrt(0.5 * math.pi / count[rows] + u_model**2))
    score = np.cumsum(z) / np.sqrt(np.arange(1, z.size + 1))
    score[: FEWEST_FOR_MEDIAN - 1] = -math.inf
    n = int(np.argmax(score))
    # Three quarters of the crests must have a shortfall that one in twenty others has: echoes occur at some only.
    each = np.quantile(z[: n + 1], 0.25) >= normal_quantile(0.9)
    return int(rows[n]) + 1 if each and score[n] > normal_quantile(1.0 - FALSE_ALARM / z.size) else 0


def _end(fit: _Fit, sign: float, sigma: float) -> _End | None:
    """Return the level and the windows clipped at one end, or None if the motion is not clipped there."""
    n = _clipped_windows(fit, sign, sigma)
    outer = fit.judged[:n] & (fit.height(sign)[:n] > MIDDLE)
    if np.count_nonzero(outer) < FEWEST_FOR_MEDIAN:
        return None
    height, short = (sign * fit.model[:n])[outer], (-sign * fit.residual[:n])[outer]
    middle = float(np.median(sign * fit.rest[:n] + MIDDLE * fit.amplitude[:n]))
    levels = np.linspace(middle, float(height.max()), HEIGHTS, endpoint=False)
    left = np.sum(np.abs(short - np.maximum(height - levels[:, None], 0.0)), axis=1)
    best = int(np.argmin(left))
    share = fit.height(sign)[:n][outer]
    shape = np.stack([share**2, share**3], axis=1)
    bent = short - shape @ np.linalg.lstsq(shape, short, rcond=None)[0]
    if best == 0 or left[best] > np.sum(np.abs(bent)):
        return None
    plateau = (height - short)[height > levels[best]]
    return _End(sign, min(float(levels[best]), float(np.quantile(plateau, 1.0 - LIMIT))), n)


def _beyond(fit: _Fit, ends: list[_End]) -> Bools:
    """Return (w, l): whether the model at a sample or its neighbour lies beyond a level of clipping."""
    beyond = np.zeros(fit.model.shape, np.bool_)
    for end in ends:
        beyond[: end.windows] |= (end.sign * fit.model > end.level)[: end.windows]
    wider = beyond.copy()
    wider[:, 1:] |= beyond[:, :-1]
    wider[:, :-1] |= beyond[:, 1:]
    return wider


def _median_of_rows(values: F8, chosen: Bools) -> F8:
    """Return (w,): the median of the chosen values in each row; at least one must be chosen."""
    ordered = np.sort(np.where(chosen, values, np.inf), axis=1)
    rows, count = np.arange(len(ordered)), chosen.sum(axis=1)
    return np.asarray(0.5 * (ordered[rows, (count - 1) // 2] + ordered[rows, count // 2]))
