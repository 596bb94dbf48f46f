"""Clipping: crests that a fixed object or a lost target cuts, left out by the motion that the middle of a swing shows.

A level plateau shows in the distances alone (:mod:`pipeline.samples.condition`). One that wanders from crest to crest,
lies at both ends or goes with the first cycles does not: it shows against the middle of the swing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.robust import mad_sigma
from pipeline.samples.condition import Conditioned, Cut
from pipeline.track import F8, Quality
from pipeline.windows.cycles import Cycles
from pipeline.windows.demodulate import Demodulated
from pipeline.windows.sinusoids import Windows, refit, solve

__all__ = ["Params", "find_cuts"]

LEVELS = 40  # heights tried for the level, from the middle of the swing to its top
LEAST_SAMPLES = 3  # of a crest, for a median
FAR_OFF = 5.0  # standard deviations beyond which a sample is a false echo: one normal deviation in two million
SHARE_BEYOND = 0.05  # of the samples of a plateau that lie below the level from which on they are left out
SETTLING, ROUNDS = 8, 11  # fits until the middle of the swing is free of what the crests made of the first; of all

Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of :func:`find_cuts`.

    Parameters
    ----------
    false_alarm : float
        Probability that crests of an uncut motion in white noise fall short by so much at either end.
    each : float
        Standard uncertainties by which three quarters of the crests have to fall short, each by itself: one in twenty
        of those that are not cut does. Clusters of echoes come at some crests and not at others.
    least_crests : int
        Fewer than that may be struck by echoes one after another.
    middle : float
        Of the amplitude: what lies within is not cut, so that the sinusoid is known.
    crest : float
        Of the amplitude: the crest lies beyond, within 30 degrees of the turning point.
    """

    false_alarm: float = 1e-3
    each: float = 1.645
    least_crests: int = 3
    middle: float = 0.5
    crest: float = math.cos(math.pi / 6.0)


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """Every window's sinusoid.

    ``rest`` and ``amplitude`` (w,), m; ``model``, ``residual`` and the model's uncertainty over the samples' ``u``
    (w, l), m, m, 1; ``judged`` (w, l): samples that may be judged.
    """

    rest: F8
    amplitude: F8
    model: F8
    residual: F8
    u: F8
    judged: Bools

    def height(self, sign: float) -> F8:
        """(w, l): how far towards an end the model goes, over its amplitude."""
        return np.asarray(sign * (self.model - self.rest[:, None]) / self.amplitude[:, None])


@dataclass(frozen=True, slots=True, eq=False)
class _End:
    """The first windows' crests are cut at one end, from a distance on, m, times the end's sign."""

    sign: float
    level: float
    windows: int


def find_cuts(
    conditioned: Conditioned, cycles: Cycles, demodulated: Demodulated, params: Params | None = None
) -> Conditioned | None:
    """Return the record with every crest flagged that is cut, or None where none shows beyond what is flagged already.

    Parameters
    ----------
    conditioned, cycles, demodulated
        Outputs of the stages of those names.
    params : Params, optional

    Notes
    -----
    Every window's sinusoid is fitted to the middle of its swing. With :math:`z_j` by how many standard uncertainties
    the median of crest j falls short of it, crests are cut from the first to the n-th where
    :math:`\\sum_{j \\le n} z_j/\\sqrt n` is greatest, if that exceeds what noise does at any n with probability
    ``false_alarm`` (Bonferroni's bound): a bob that loses its amplitude reaches a fixed object first and then no more.

    Beyond its level l a fixed object takes all of the way, :math:`\\max(0, h - l)` at height h. The level is the one
    that leaves least, and it must leave less than :math:`c_2 h^2 + c_3 h^3`, as which a bent scale or another shape of
    the motion shows beside a sinusoid through its middle. Samples are left out where the model lies beyond what
    nineteen in twenty of those on the plateau lie beyond, and one on either side, whatever they say themselves: that
    brings no bias.
    """
    params = params or Params()
    least_m = max(conditioned.noise_m, (conditioned.quantum_m or 0.0) / math.sqrt(12.0))
    unexplained = _of_windows(Windows.cut(conditioned, cycles.bounds), demodulated)
    if not any(_cut_windows(unexplained, sign, least_m, params) for sign in (1.0, -1.0)):
        return None
    flags = conditioned.flags.copy()
    seen = slice(int(cycles.bounds[0]), int(cycles.bounds[-1]))
    flags[seen] = flags[seen] & ~np.uint8(Quality.CLIPPED) | conditioned.track.flags[seen]
    windows = Windows.cut(replace(conditioned, flags=flags), cycles.bounds)
    least = max(least_m, windows.tiny)
    whole = _of_windows(windows, demodulated)
    decay = np.interp(windows.centre, demodulated.t, demodulated.decay)
    basis = windows.basis(np.full(decay.size, demodulated.angular_frequency), decay)
    inside = np.abs(whole.height(1.0)) < params.middle
    ends: list[_End] = []
    for step in range(ROUNDS):
        fit, sigma = _fitted(windows, basis, inside, least)
        inside = np.abs(fit.height(1.0)) < params.middle
        if step < SETTLING:
            continue
        ends = [end for sign in (1.0, -1.0) if (end := _end(fit, sign, sigma, params)) is not None]
        if not ends:
            return None
        inside = ~_beyond(fit, ends)
    cuts = []
    for end in ends:
        beyond = _beyond(fit, [end]) & fit.judged
        cuts.append(_described(end, fit, windows, conditioned, beyond))
        flags[windows.rows[beyond]] |= np.uint8(Quality.CLIPPED)
    return replace(
        conditioned, flags=flags, plateaus_m=tuple(cut.level_m for cut in cuts), clipped_from_m=(), cuts=tuple(cuts)
    )


def _of_windows(windows: Windows, demodulated: Demodulated) -> _Fit:
    """The fits that went through the crests too: they still leave them off by a third of what they fall short by."""
    residual = np.nan_to_num(demodulated.residual[windows.rows])
    rest, amplitude = (
        np.interp(windows.centre, demodulated.t, x) for x in (demodulated.offset, np.abs(demodulated.amplitude))
    )
    model = windows.y - residual
    return _Fit(rest - windows.level, amplitude, model, residual, np.zeros_like(model), windows.usable > 0)


def _fitted(windows: Windows, basis: F8, inside: Bools, least: float) -> tuple[_Fit, float]:
    """Every window's sinusoid through some of its samples, false echoes left out, and the noise about it, m."""
    usable = windows.usable > 0
    solution = solve(basis, (inside & usable).astype(np.float64))
    sigma = max(least, mad_sigma(solution.residual[inside & usable & solution.good[:, None]]))
    refit(basis, solution, (inside & usable & (np.abs(solution.residual) < FAR_OFF * sigma)).astype(np.float64))
    rest, a, b = solution.coefficients.T
    part = basis[:, :3]
    u = np.sqrt(np.maximum(np.sum(part * (solution.inverse @ part), axis=1), 0.0))
    size = np.maximum(np.hypot(a, b), windows.tiny)
    judged = usable & solution.good[:, None]
    return _Fit(rest, size, windows.y - solution.residual, solution.residual, u, judged), sigma


def _cut_windows(fit: _Fit, sign: float, sigma: float, params: Params) -> int:
    """Number of windows from the first on whose crests fall short, 0 where noise may do that."""
    crest = fit.judged & (fit.height(sign) > params.crest)
    count = crest.sum(axis=1)
    rows = np.flatnonzero(count >= LEAST_SAMPLES)
    if rows.size < params.least_crests:
        return 0
    short = _median_of_rows(-sign * fit.residual[rows], crest[rows])
    u_model = np.max(np.where(crest[rows], fit.u[rows], 0.0), axis=1)
    z = short / (sigma * np.sqrt(0.5 * math.pi / count[rows] + u_model**2))
    score = np.cumsum(z) / np.sqrt(np.arange(1, z.size + 1))
    score[: params.least_crests - 1] = -math.inf
    n = int(np.argmax(score))
    if (
        score[n] <= -NormalDist().inv_cdf(0.5 * params.false_alarm / z.size)
        or np.quantile(z[: n + 1], 0.25) < params.each
    ):
        return 0
    return int(rows[n]) + 1


def _end(fit: _Fit, sign: float, sigma: float, params: Params) -> _End | None:
    """Where the motion is cut at one end, if it is."""
    n = _cut_windows(fit, sign, sigma, params)
    outer = fit.judged[:n] & (fit.height(sign)[:n] > params.middle)
    if np.count_nonzero(outer) < LEAST_SAMPLES:
        return None
    height, short = (sign * fit.model[:n])[outer], (-sign * fit.residual[:n])[outer]
    middle = float(np.median(sign * fit.rest[:n] + params.middle * fit.amplitude[:n]))
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
    """(w, l): where the model lies beyond the level at which the motion is cut, or one sample from there."""
    beyond = np.zeros(fit.model.shape, np.bool_)
    for end in ends:
        beyond[: end.windows] |= (end.sign * fit.model > end.level)[: end.windows]
    wider = beyond.copy()
    wider[:, 1:] |= beyond[:, :-1]
    wider[:, :-1] |= beyond[:, 1:]
    return wider


def _described(end: _End, fit: _Fit, windows: Windows, conditioned: Conditioned, beyond: Bools) -> Cut:
    t = conditioned.track.t[windows.rows[beyond]]
    height, y = end.sign * fit.model[beyond], (fit.model + fit.residual)[beyond]
    level = float(np.median(y[height >= np.median(height)])) + windows.level
    start = float(end.sign * end.level + windows.level)
    return Cut("far" if end.sign > 0.0 else "near", start, level, int(t.size), float(t.min()), float(t.max()))


def _median_of_rows(values: F8, chosen: Bools) -> F8:
    """(w,): the median of the values chosen in each row, one at least."""
    ordered = np.sort(np.where(chosen, values, np.inf), axis=1)
    rows, count = np.arange(len(ordered)), chosen.sum(axis=1)
    return np.asarray(0.5 * (ordered[rows, (count - 1) // 2] + ordered[rows, count // 2]))
