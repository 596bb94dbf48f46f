"""Demodulate: amplitude, phase, rest position and noise against time, window by window, with covariance.

No library fits every period robustly. In the bundled damped recording, clusters of false echoes lie at the turning
points. One least-squares fit of a damped sine gives an amplitude with an error of 3.68 mm there; the demodulation's
error is 0.01 mm (``docs/decisions/0004-demodulation-first.md``). :mod:`pipeline.windows.sinusoids` contains the linear
fit and the tuning of its basis. This module contains the passes: ignore clusters, rescue, clip, tune, clip.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import AnalysisError
from pipeline.numerics.levels import (
    FALSE_ALARM,
    FEWEST_FOR_LINE,
    FEWEST_FOR_MEDIAN,
    NOTICEABLE,
    OUTLIER,
    VERY_STRONG,
    normal_quantile,
)
from pipeline.numerics.regression import scatter, smooth_curve
from pipeline.numerics.robust import mad_sigma, median
from pipeline.samples.condition import Samples
from pipeline.track import F8, U8, UNUSABLE, Quality
from pipeline.windows.cycles import Cycles, cut
from pipeline.windows.sinusoids import Tuning, WindowFits, WindowSamples, quantile, refit, retune, solve, unwrap

# Amplitude in standard uncertainties below which amplitude and phase are taken along a smooth phase. Its phase is then
# uncertain by 1/7 rad, and the probability that noise turns it by more than 1 rad is 3e-12.
WEAK = 7.0
# Relative error of a window's sinusoid after two passes, as measured on computed records without noise (`python -m
# tests.golden --only noise`).
ROUNDING = 2e-6
# Scatter relative to the amplitude; only computed records have less. The bundled recordings have 2e-3, as measured by
# `springmass analyse`.
FINEST = 1e-4
# Residuals beyond this many standard deviations are false echoes and are excluded from the fit: a normal one has a
# probability of 6e-5.
CLIP_SIGMAS = 4.0
# Share of the samples of a window that set the scale of the weights where echoes may be the majority. With clusters on
# 30 % of the samples the measured median error of an amplitude is 26 um, and 189 um without such fits.
MINORITY = 0.3
# Number of reweighted fits of windows with false echoes, before the final fits. With five, a few echoes differ in one
# of five recordings, and no verdict, as measured by `python -m tests.golden` and `python -m tests.trials.troubles`.
REWEIGHTINGS = 3


@dataclass(frozen=True, eq=False)
class Windows:
    """The oscillation in windows of whole periods, on which every later stage works.

    In window j the motion is :math:`o_j + A_j e^{-g\\tau}\\cos(\\omega\\tau + \\varphi_j)`, with :math:`\\tau`
    counted from the window's centre.
    """

    cycles: Cycles  # from which the windows were cut
    t: F8  # (w,) s, centres of the windows
    # amplitude, phase, offset: (w,) m, rad, m, values at the centre of each window. The phase is unwrapped: the total
    # phase of the oscillation.
    amplitude: F8
    phase: F8
    offset: F8
    noises: F8  # (w,) m, standard deviation of the samples about the fit, for each window separately
    # (w, 3, 3) covariance of (amplitude, phase, offset). Windows share no samples, so they are independent of each
    # other.
    covariance: F8
    count: NDArray[np.int64]  # (w,) number of samples used in the fit
    angular_frequency: float  # rad/s, angular frequency of the basis
    decay: F8  # (w,) 1/s, decay rate g of the basis
    residual: F8  # (n,) m, every sample less its window's fit; NaN for samples outside all windows or not measured
    flags: U8  # (n,) flags from the conditioning, with the false echoes found here
    lost: int  # number of windows with too few usable samples, which give no point

    @property
    def used(self) -> NDArray[np.bool_]:
        """(n,) bool: True for samples without any flag that excludes them."""
        return np.asarray((self.flags & UNUSABLE) == 0, np.bool_)

    @cached_property
    def noise(self) -> float:
        """Standard deviation of one sample over the whole record, m."""
        dof = np.maximum(self.count - 3, 1)
        return math.sqrt(float((dof * self.noises**2).sum()) / float(dof.sum()))


def demodulate(samples: Samples, cycles: Cycles) -> Windows:
    """Fit rest position, amplitude and phase robustly in every window.

    Every window is a linear least-squares problem in :math:`(o, a, b)` of
    :math:`o + e^{-g\\tau}(a\\cos\\omega\\tau - b\\sin\\omega\\tau)`; all are solved together. False echoes come in
    clusters that move with the bob and last a fifth of a period or more, so they may bias the first fit of a window.
    Weights of Cauchy's form, with a scale that shrinks from round to round, release the fit from them. Windows that
    disagree with their neighbours are fitted again from the neighbours' values. Then residuals beyond
    :data:`CLIP_SIGMAS` are excluded permanently. A second pass uses the decay :math:`g` of each window. Without it, the
    conjugate line would bias the amplitude by the fraction :math:`g/2\\omega`. A rest position that moves or creeps is
    part of the motion: how far it moves within the windows is subtracted, and they are fitted again.
    """
    windows = WindowSamples.sliced(samples, cycles.bounds)
    tuning = Tuning.constant(2.0 * math.pi * cycles.frequency_hz, len(windows.y))
    fitted, solution, tuned = _passes(samples, windows, tuning)
    if (moved := _moved(windows, solution, tuned)) is not None:
        fitted, solution, tuned = _passes(samples, replace(windows, y=windows.y - moved, moved=moved), tuning)
    return _finish(samples, cycles, fitted, solution, tuned)


def _passes(samples: Samples, windows: WindowSamples, tuning: Tuning) -> tuple[WindowSamples, WindowFits, Tuning]:
    """Fit every window in two passes; return also the windows without clipped crests, and the tuning."""
    basis = windows.basis(tuning.turning, tuning.decay)
    rough = retune(windows, solve(basis, windows.usable), tuning.angular_frequency, degree=1)
    basis = windows.decaying(basis, rough.decay)
    solution, spread = _ignore_clusters(windows, basis, samples.noise)
    solution, spread = _rescue(windows, basis, solution, spread, tuning)
    solution = _clip(windows, basis, solution, spread, rough)
    weights = solution.weights
    if samples.clipped_from:
        level = _typical(_spread(windows.usable, solution.residual), windows, solution)
        crest = samples.near_plateau(windows.y - solution.residual + windows.moved + windows.level, level)
        windows = replace(windows, usable=np.where(crest, 0.0, windows.usable))
        weights = np.where(crest, 0.0, weights)
    # Fit again with each window's own frequency and decay.
    tuning = retune(windows, solution, tuning.angular_frequency)
    basis = windows.basis(tuning.turning, tuning.decay)
    solution = solve(basis, weights)
    solution = _clip(windows, basis, solution, _spread(windows.usable, solution.residual), tuning)
    return windows, solution, tuning


def _moved(windows: WindowSamples, fits: WindowFits, tuning: Tuning) -> F8 | None:
    """Return how far a smooth rest position is from that at the window's centre, (w, l); None if it is no matter.

    It must lower the BIC of the samples within the windows by more than :data:`VERY_STRONG`, and they must ask for it
    times a factor of 0.5 to 1.5: rest positions that are wrong, as of windows that are no whole periods, make a curve
    that the samples do not follow.
    """
    good, t = fits.good, windows.centre
    if np.count_nonzero(good) < FEWEST_FOR_MEDIAN:
        return None
    squares, count = np.sum(fits.weights * fits.residual**2, axis=1)[good], fits.normal[good, 0, 0]
    u = np.maximum(np.sqrt(squares) / np.maximum(count - 3.0, 1.0), windows.tiny)
    offset = fits.coefficients[good, 0]
    curve, _ = smooth_curve(t[good], offset, scatter(t[good], offset, u))
    moved = np.asarray(curve.deriv()(np.clip(t, *curve.domain)))[:, None] * windows.tau
    basis = windows.basis(tuning.turning, tuning.decay)
    basis[:, 3] = moved
    beyond = solve(basis, fits.weights).residual
    size, along = (float(np.sum(fits.weights * beyond * x)) for x in (beyond, fits.residual))
    strong = 2.0 * along - size > VERY_STRONG * float(squares.sum()) / float(count.sum())
    return moved if strong and abs(along - size) < 0.5 * size else None


def follow(windows: Windows, recorded: F8) -> Cycles:
    """Cut the windows anew, along the phase, if the period changes: those of equal length are then no whole periods."""
    t, phase, u_phase = windows.t, windows.phase, np.sqrt(windows.covariance[:, 1, 1])
    cycles, span = windows.cycles, FEWEST_FOR_LINE
    if t.size < 2 * span:
        return cycles
    rate = (phase[span:] - phase[:-span]) / (t[span:] - t[:-span])
    u_rate = np.hypot(u_phase[span:], u_phase[:-span]) / (t[span:] - t[:-span])
    mean = float(phase[-1] - phase[0]) / float(t[-1] - t[0])
    if not np.any(np.abs(rate - mean) > np.maximum(NOTICEABLE * mean, OUTLIER * u_rate)) or rate.min() <= 0.5 * mean:
        return cycles
    first, last = recorded[cycles.bounds[0]], recorded[cycles.bounds[-1] - 1]
    begin = float(phase[0]) + float(rate[0]) * float(first - t[0])
    end = float(phase[-1]) + float(rate[-1]) * float(last - t[-1])
    count = int((end - begin) / (2.0 * math.pi * cycles.periods) + 1e-6)
    edges = np.interp(np.linspace(begin, end, count + 1), [begin, *phase, end], [first, *t, last])
    return replace(cycles, bounds=cut(recorded, edges, int(cycles.bounds[-1])))


def _ignore_clusters(windows: WindowSamples, basis: F8, noise: float) -> tuple[WindowFits, F8]:
    """Fit every window; where the scatter exceeds the noise, use weights that ignore clusters of echoes.

    Returns the fits and the spreads (w,) of the samples about them.
    """
    solution = solve(basis, windows.usable)
    spread = _spread(windows.usable, solution.residual)
    odd = np.flatnonzero(spread > 1.3 * noise)
    if odd.size:
        size, least = np.abs(solution.residual[odd]), noise + windows.tiny
        solution = solution.put(odd, _reweighted(basis[odd], windows.usable[odd], size, 0.5, least))
        spread[odd] = _spread(windows.usable[odd], solution.residual[odd])
    return solution, spread


def _rescue(
    windows: WindowSamples, basis: F8, solution: WindowFits, spread: F8, tuning: Tuning
) -> tuple[WindowFits, F8]:
    """Fit windows that disagree with their neighbours again, starting from the neighbours' prediction.

    Where half of a window consists of false echoes, its own fit may have converged to them. The amplitude, phase and
    rest position of the surrounding windows show which half to believe.
    """
    n = len(windows.y)
    if n < FEWEST_FOR_LINE:
        return solution, spread
    # The phases are referred to one instant, so that medians are taken of slowly varying quantities.
    turning = np.exp(1j * tuning.angular_frequency * (windows.centre - windows.centre[0]))
    steady = (solution.coefficients[:, 1] + 1j * solution.coefficients[:, 2]) / turning
    slow = np.stack([solution.coefficients[:, 0], steady.real, steady.imag])
    rest, real, imaginary = np.median(slow[:, _neighbours(n)], axis=2)
    smooth = (real + 1j * imaginary) * turning
    expected = np.stack([rest, smooth.real, smooth.imag], axis=1)
    away = np.abs(solution.coefficients - expected).max(axis=1)
    level = _typical(spread, windows, solution)
    bound = CLIP_SIGMAS * level
    before = np.sum((np.abs(solution.residual) <= bound) * windows.usable, axis=1)
    few = before < 0.7 * windows.usable.sum(axis=1)
    odd = np.flatnonzero((away > OUTLIER * mad_sigma(away)) | few | ~solution.good)
    if not odd.size:
        return solution, spread
    part, usable = basis[odd], windows.usable[odd]
    size = np.abs(part[:, 3] - (expected[odd, None, :] @ part[:, :3])[:, 0])
    # Only the best samples set the scale, so that echoes may make up more than half of a window.
    trial = _reweighted(part, usable, size, MINORITY, level)
    after = np.sum((np.abs(trial.residual) <= bound) * usable, axis=1)
    better = trial.good & ((after > before[odd]) | ~solution.good[odd])
    spread = spread.copy()
    spread[odd[better]] = _spread(usable[better], trial.residual[better])
    return solution.put(odd[better], trial, better), spread


def _reweighted(basis: F8, usable: F8, size: F8, believed: float, least: float) -> WindowFits:
    """Fit windows with weights of Cauchy's form, :math:`(1 + (r/s)^2)^{-2}`, from residuals of a given size (w, l).

    The scale s is the quantile of the residuals at the share ``believed``, over that of normal deviates, but at least
    ``least``.
    """
    for _ in range(REWEIGHTINGS):
        spread = np.maximum(quantile(size, usable, believed) / normal_quantile(believed), least)
        solution = solve(basis, usable / (1.0 + (size / spread[:, None]) ** 2) ** 2)
        size = np.abs(solution.residual)
    return solution


def _neighbours(n: int) -> NDArray[np.int64]:
    """Return (n, 6 or fewer): the nearest other windows of each window, one-sided at the record's ends."""
    reach = min(7, n)
    first = np.clip(np.arange(n) - reach // 2, 0, n - reach)
    block = first[:, None] + np.arange(reach)
    others: NDArray[np.int64] = block[block != np.arange(n)[:, None]].reshape(n, reach - 1)
    return others


def _spread(usable: F8, residual: F8) -> F8:
    """Return (w,): the standard deviation of each window's samples about its fit, from their median deviation."""
    return quantile(np.abs(residual), usable, 0.5) / normal_quantile(0.5)


def _typical(spread: F8, windows: WindowSamples, solution: WindowFits) -> float:
    """Return the median spread of the record's good windows."""
    return max(median(spread[solution.good]) if solution.good.any() else 0.0, windows.tiny)


def _clip(windows: WindowSamples, basis: F8, solution: WindowFits, spread: F8, tuning: Tuning) -> WindowFits:
    """Exclude samples with residuals beyond the clipping bound and fit again."""
    level = _typical(spread, windows, solution)
    # One window's spread is uncertain, and a cluster of echoes widens it, so it is kept near the record's.
    size = np.hypot(solution.coefficients[:, 1], solution.coefficients[:, 2])
    least = model_error(size, tuning.decay, tuning.angular_frequency)
    bound = CLIP_SIGMAS * np.maximum(np.clip(spread, 0.75 * level, 2.0 * level), least)
    return refit(basis, solution, np.where(np.abs(solution.residual) <= bound[:, None], windows.usable, 0.0))


def model_error(amplitude: F8, decay: F8, angular_frequency: float) -> F8:
    """Return the residual, m, that a sinusoid can leave of a noiseless motion; smaller residuals are never echoes.

    It is a ten-thousandth of the amplitude plus twice the third harmonic :math:`A g/20\\omega` of quadratic drag.
    """
    return (FINEST + np.abs(decay) / (10.0 * angular_frequency)) * np.abs(amplitude)


def _finish(samples: Samples, cycles: Cycles, windows: WindowSamples, solution: WindowFits, tuning: Tuning) -> Windows:
    good, weights = solution.good, solution.weights
    if not good.any():
        raise AnalysisError(
            "no period of the record holds enough usable samples for a fit", "see the counts of flagged samples"
        )
    counts = (weights > 0).sum(axis=1)
    squares = np.sum(weights * solution.residual**2, axis=1)
    noise = np.sqrt(squares / np.maximum(counts - 3, 1))
    pooled = math.sqrt(np.sum(squares[good]) / max(np.sum(counts[good] - 3), 1))
    pooled = with_prior(pooled, float(np.sum(counts[good] - 3)), samples.track.sigma_m)
    # A window's own noise is uncertain by about a tenth, so it is shrunk towards the record's.
    prior = 30.0
    shrunk = ((prior * pooled**2 + counts * noise**2) / (prior + counts))[good]
    _, a, b = solution.coefficients[good].T
    t = windows.centre[good]
    smooth = unwrap(np.arctan2(b, a), t, tuning.angular_frequency) if tuning.phase is None else tuning.phase[good]
    expected = None if tuning.amplitude is None else tuning.amplitude[good]
    amplitude, phase, covariance = polar(a, b, solution.inverse[good] * shrunk[:, None, None], smooth, expected)
    flags = samples.flags.copy()
    inside = windows.placed & good[:, None]
    echoes = inside & (windows.usable > 0) & (weights == 0)
    flags[windows.rows[echoes]] |= np.uint8(Quality.FALSE_ECHO)
    crests = inside & (windows.usable == 0)
    if crests.any():
        crests &= flags[windows.rows] == 0
        flags[windows.rows[crests]] |= np.uint8(Quality.CLIPPED)
    residual = np.full(len(samples.track), np.nan)
    residual[windows.rows[inside]] = solution.residual[inside]
    return Windows(
        cycles=cycles,
        t=t,
        amplitude=amplitude,
        phase=phase,
        offset=solution.coefficients[good, 0] + windows.level,
        noises=noise[good],
        covariance=covariance,
        count=counts[good],
        angular_frequency=tuning.angular_frequency,
        decay=tuning.decay[good],
        residual=residual,
        flags=flags,
        lost=int(np.count_nonzero(~good)),
    )


def with_prior(noise: float, dof: float, stated: float | None) -> float:
    """Return the record's noise, combined with the noise that sensor or scene states if the two agree.

    A stated noise counts as much as thirty samples, so it matters only to records of a few periods.
    """
    if stated is None or abs(noise / stated - 1.0) > normal_quantile(1.0 - FALSE_ALARM) / math.sqrt(
        2.0 * max(dof, 1.0)
    ):
        return noise
    return math.sqrt((dof * noise**2 + 30.0 * stated**2) / (dof + 30.0))


def polar(a: F8, b: F8, covariance: F8, smooth_phase: F8, smooth_amplitude: F8 | None) -> tuple[F8, F8, F8]:
    """Return amplitude, total phase and covariance of (amplitude, phase, offset) of windows.

    The amplitude :math:`\\sqrt{a^2+b^2}` is too large by half the variance of the phase, as a fraction; this bias is
    subtracted. Where the smooth amplitude is below seven times the amplitude's uncertainty, amplitude and phase are the
    components along and across the smooth phase instead. These are linear in a and b and therefore unbiased in any
    noise, and an amplitude may be negative.
    """
    size = np.hypot(a, b)
    # A negligible magnitude is raised to a small positive one before anything is divided by it, whatever the unit.
    least = 1e-30 * float(size.max()) + 1e-150
    size = np.maximum(size, least)
    along, scale = np.arctan2(b, a), size
    weak = np.zeros(a.size, np.bool_)
    if smooth_amplitude is not None:
        u = np.sqrt(0.5 * (covariance[:, 1, 1] + covariance[:, 2, 2]))
        # A window whose own amplitude is below its uncertainty is weak too, regardless of the curve.
        weak = (smooth_amplitude < WEAK * u) | (size < u)
        along = np.where(weak, smooth_phase, along)
        scale = np.where(weak, np.maximum(smooth_amplitude, 0.3 * u), size)
    cosine, sine = np.cos(along), np.sin(along)
    turned = np.remainder(along - smooth_phase + math.pi, 2.0 * math.pi) - math.pi
    if np.ptp(turned) > math.pi:
        turned[~weak] = np.unwrap(turned[~weak])
    turned = np.where(weak, (b * cosine - a * sine) / scale, turned)
    # Derivatives of (amplitude, phase, offset) with respect to (offset, a, b).
    slope = np.zeros_like(covariance)
    slope[:, 0, 1], slope[:, 0, 2] = cosine, sine
    slope[:, 1, 1], slope[:, 1, 2] = -sine / scale, cosine / scale
    slope[:, 2, 0] = 1.0
    turned_into = slope @ covariance @ slope.transpose(0, 2, 1)
    amplitude = np.where(weak, a * cosine + b * sine, size * (1.0 - 0.5 * np.minimum(turned_into[:, 1, 1], 1.0)))
    return np.where(amplitude == 0.0, least, amplitude), smooth_phase + turned, turned_into
