"""Clipping: crests cut off by a fixed object or a lost target, found by comparison with the middle of the swing.

A level plateau shows in the distances alone (:mod:`pipeline.samples.condition`). A plateau that changes from crest to
crest, lies at both ends or ends after the first cycles does not; it shows in comparison with the middle of the swing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.levels import FALSE_ALARM, FEWEST_FOR_MEDIAN, OUTLIER, ROUNDS, normal_quantile
from pipeline.numerics.robust import mad_sigma
from pipeline.samples.condition import Conditioned, Cut
from pipeline.track import F8, Quality
from pipeline.windows.cycles import Cycles
from pipeline.windows.demodulate import ROUNDING, Demodulated
from pipeline.windows.sinusoids import Windows, refit, solve

# Number of heights tried for the level, from the middle of the swing to its top. With 80, amplitudes of clipped records
# move by up to 0.05 u, as measured by `python -m tests.trials.troubles --only clipped`.
LEVELS = 40
# Share of a plateau's samples below the level beyond which samples are left out. With 0.1, amplitudes of clipped
# records of `python -m tests.golden` move by up to 0.1 u.
SHARE_BEYOND = 0.05

Bools = NDArray[np.bool_]
# Fraction of the amplitude within which the motion is never cut, so that the sinusoid can be fitted: a sample lies
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
    """One end at which the crests of the first windows are cut beyond a level: distance times the end's sign, m."""

    sign: float
    level: float
    windows: int


def find_cuts(conditioned: Conditioned, cycles: Cycles, demodulated: Demodulated) -> Conditioned | None:
    """Return the record with every cut crest flagged, or None if no cuts show beyond those flagged already.

    Every window's sinusoid is fitted to the middle of its swing. Let :math:`z_j` be the shortfall of the median of
    crest j in standard uncertainties. Crests 1 to n are cut if n maximises :math:`\\sum_{j \\le n} z_j/\\sqrt n` and
    this exceeds what noise reaches at any n with probability :data:`FALSE_ALARM` (Bonferroni's bound). The first crests
    are taken because a bob with decaying amplitude reaches a fixed object at first and later no longer.

    A fixed object removes the motion beyond its level l, so the shortfall is :math:`\\max(0, h - l)` at height h. The
    level l minimises the residual, which must be less than that of :math:`c_2 h^2 + c_3 h^3`. The latter describes a
    non-linear scale or a motion that is not sinusoidal. Samples are left out where the model lies beyond the limit that
    nineteen in twenty samples on the plateau exceed, with one more sample on either side. The model selects them, not
    their own values, so this causes no bias.
    """
    # A record whose crests are flat may show no noise at all.
    rounding_m = ROUNDING * float(np.max(np.abs(demodulated.amplitude)))
    least_m = max(conditioned.noise_of_reading_m, rounding_m)
    unexplained = _of_windows(Windows.cut(conditioned, cycles.bounds), demodulated)
    if not any(_cut_windows(unexplained, sign, least_m) for sign in (1.0, -1.0)):
        return None
    flags = conditioned.flags.copy()
    seen = slice(int(cycles.bounds[0]), int(cycles.bounds[-1]))
    flags[seen] = flags[seen] & ~np.uint8(Quality.CLIPPED) | conditioned.track.flags[seen]
    windows = Windows.cut(replace(conditioned, flags=flags), cycles.bounds)
    least = max(least_m, windows.tiny)
    whole = _of_windows(windows, demodulated)
    decay = np.interp(windows.centre, demodulated.t, demodulated.decay)
    basis = windows.basis(np.full(decay.size, demodulated.angular_frequency), decay)
    inside = np.abs(whole.height(1.0)) < MIDDLE
    ends: list[_End] = []
    for step in range(2 * ROUNDS):
        fit, sigma = _fitted(windows, basis, inside, least)
        inside = np.abs(fit.height(1.0)) < MIDDLE
        if step < ROUNDS:  # the cut crests still affect the middle of the swing
            continue
        ends = [end for sign in (1.0, -1.0) if (end := _end(fit, sign, sigma)) is not None]
        if not ends:
            return None
        inside = ~_beyond(fit, ends)
    cuts = []
    for end in ends:
        beyond = _beyond(fit, [end]) & fit.judged
        rows, height = windows.rows[beyond], end.sign * fit.model[beyond]
        t, y = conditioned.track.t[rows], (fit.model + fit.residual)[beyond]
        level_m = float(np.median(y[height >= np.median(height)])) + windows.level
        from_m = float(end.sign * end.level + windows.level)
        which: Literal["far", "near"] = "far" if end.sign > 0.0 else "near"
        cuts.append(Cut(which, from_m, level_m, int(t.size), float(t.min()), float(t.max())))
        flags[rows] |= np.uint8(Quality.CLIPPED)
    levels_m = tuple(cut.level_m for cut in cuts)
    return replace(conditioned, flags=flags, plateaus_m=levels_m, clipped_from_m=(), cuts=tuple(cuts))


def _of_windows(windows: Windows, demodulated: Demodulated) -> _Fit:
    """Return the fits that include the crests; their residuals still show a third of the shortfall."""
    residual = np.nan_to_num(demodulated.residual[windows.rows])
    rest, amplitude = (
        np.interp(windows.centre, demodulated.t, x) for x in (demodulated.offset, np.abs(demodulated.amplitude))
    )
    model = windows.y - residual
    return _Fit(rest - windows.level, amplitude, model, residual, np.zeros_like(model), windows.usable > 0)


def _fitted(windows: Windows, basis: F8, inside: Bools, least: float) -> tuple[_Fit, float]:
    """Fit every window's sinusoid to selected samples without false echoes; return it and the noise, m."""
    usable = windows.usable > 0
    solution = solve(basis, (inside & usable).astype(np.float64))
    middle = solution.residual[inside & usable & solution.good[:, None]]
    sigma = max(least, mad_sigma(middle)) if middle.size else least
    refit(basis, solution, (inside & usable & (np.abs(solution.residual) < OUTLIER * sigma)).astype(np.float64))
    rest, a, b = solution.coefficients.T
    part = basis[:, :3]
    u = np.sqrt(np.maximum(np.sum(part * (solution.inverse @ part), axis=1), 0.0))
    size = np.maximum(np.hypot(a, b), windows.tiny)
    judged = usable & solution.good[:, None]
    return _Fit(rest, size, windows.y - solution.residual, solution.residual, u, judged), sigma


def _cut_windows(fit: _Fit, sign: float, sigma: float) -> int:
    """Return the number of first windows whose crests are cut; 0 if noise can explain the shortfall."""
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
    # Three quarters of the crests must have a shortfall that one in twenty uncut ones has: echoes occur at some only.
    each = np.quantile(z[: n + 1], 0.25) >= normal_quantile(0.9)
    return int(rows[n]) + 1 if each and score[n] > normal_quantile(1.0 - FALSE_ALARM / z.size) else 0


def _end(fit: _Fit, sign: float, sigma: float) -> _End | None:
    """Return the level and the windows of a cut at one end, or None if the motion is not cut there."""
    n = _cut_windows(fit, sign, sigma)
    outer = fit.judged[:n] & (fit.height(sign)[:n] > MIDDLE)
    if np.count_nonzero(outer) < FEWEST_FOR_MEDIAN:
        return None
    height, short = (sign * fit.model[:n])[outer], (-sign * fit.residual[:n])[outer]
    middle = float(np.median(sign * fit.rest[:n] + MIDDLE * fit.amplitude[:n]))
    levels = np.linspace(middle, float(height.max()), LEVELS, endpoint=False)
    left = np.sum(np.abs(short - np.maximum(height - levels[:, None], 0.0)), axis=1)
    best = int(np.argmin(left))
    share = fit.height(sign)[:n][outer]
    shape = np.stack([share**2, share**3], axis=1)
    bent = short - shape @ np.linalg.lstsq(shape, short, rcond=None)[0]
    if best == 0 or left[best] > np.sum(np.abs(bent)):
        return None
    plateau = (height - short)[height > levels[best]]
    return _End(sign, min(float(levels[best]), float(np.quantile(plateau, SHARE_BEYOND))), n)


def _beyond(fit: _Fit, ends: list[_End]) -> Bools:
    """Return (w, l): whether the model at a sample or its neighbour lies beyond the level of a cut."""
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
