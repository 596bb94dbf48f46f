"""Generic checks: does one model describe the whole run?

These checks name no cause. They test whether the residuals are larger than the noise of the samples, whether they are
white at all lags, whether the phases scatter as their noise predicts, and whether both halves of the run agree with one
model.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

import numpy as np

from pipeline.checks.residuals import Residuals
from pipeline.motion.averaged import Fitted
from pipeline.numerics.regression import chi2_quantile
from pipeline.track import F8
from pipeline.windows.demodulate import ROUNDING

# Maximum ratio of the residuals of the whole model to the noise within a period. Above it the model counts as
# incomplete, because the part that it does not describe is about as large as the noise.
EXCESS = 1.5
FALSE_ALARM = 1e-4  # probability that the phases, or the halves, of a run that follows its model contradict it
COLOUR = 0.5  # correlation of the residuals, at any lag, above which they are not noise
LEAST_SHARE = 0.01  # minimum of the predictable part of the residuals, over the amplitude: users can act on one percent
LEAST_WINDOWS = 8  # minimum number of windows in a half for the halves to be compared
# Minimum number of samples in a window for the correlation of residuals to be tested. With fewer samples, the fit of
# five parameters correlates the residuals.
LEAST_SAMPLES = 20


class Contradiction(enum.Enum):
    """How a run contradicts its model."""

    RESIDUALS = "residuals"
    PHASE = "phase"
    HALVES = "halves"
    COLOUR = "colour"


@dataclass(frozen=True, slots=True)
class ModelCheck:
    """How far a run contradicts the model that was fitted to it.

    Parameters
    ----------
    contradictions : tuple of Contradiction
    rms_m : float
        Root mean square of the residuals of the whole model.
    noise_m : float
        Standard deviation of one sample about the fit of its window.
    scatter_excess_m : float
        Scatter of the amplitudes of single windows beyond their noise.
    phase_chi2 : float
        Reduced chi-square of the phases about their model.
    halves : float
        Difference between the halves, in standard uncertainties.
    correlation, lag_s : float
        The strongest correlation of the residuals and its lag; 0 if it is below the limit.
    """

    contradictions: tuple[Contradiction, ...]
    rms_m: float
    noise_m: float
    scatter_excess_m: float
    phase_chi2: float
    halves: float
    correlation: float
    lag_s: float


def check_model(
    fitted: Fitted,
    residuals: Residuals | None,
    shortest: int,
    least_m: float,
) -> ModelCheck:
    """Return how far a run contradicts the model that was fitted to it.

    Parameters
    ----------
    fitted : Fitted
        The fit by windows.
    residuals : Residuals or None
        The residuals that no other check explains; None if another check explains all of them.
    shortest : int
        Shortest lag at which correlations of the residuals are not explained by another check.
    least_m : float
        Error of the sinusoidal model, m, which is larger than the noise of computed records.

    Notes
    -----
    The residuals of amplitudes and phases, over their standard uncertainties, are fitted by a straight line in each
    half. If the model is correct, the differences in level and slope are four standard normal numbers, of which the
    largest is tested.
    """
    from scipy.special import ndtri

    demodulated, phase, noise_m = fitted.demodulated, fitted.phase, fitted.demodulated.noise_m
    found = []
    if fitted.waveform.rms_m > EXCESS * max(noise_m, least_m):
        found.append(Contradiction.RESIDUALS)
    free = (demodulated.t.size - phase.coefficients.size) / phase.correlation
    if free >= 1.0 and phase.reduced_chi2 > chi2_quantile(1.0 - FALSE_ALARM, free) / free:
        found.append(Contradiction.PHASE)
    correlation, lag_s = (0.0, 0.0) if residuals is None else _colour(residuals, shortest)
    if correlation:
        found.append(Contradiction.COLOUR)
    halves = _halves(fitted, LEAST_WINDOWS)
    if halves > -float(ndtri(FALSE_ALARM / 8.0)):
        found.append(Contradiction.HALVES)
    return ModelCheck(
        tuple(found),
        fitted.waveform.rms_m,
        noise_m,
        fitted.damping.scatter.excess,
        phase.reduced_chi2,
        halves,
        correlation,
        lag_s,
    )


def _colour(residuals: Residuals, shortest: int) -> tuple[float, float]:
    """Return the strongest correlation of the residuals and its lag, s; 0 and 0 if it is below the limits.

    The correlations of n samples of white noise have a standard deviation of :math:`n^{-1/2}`. With the probability
    :math:`1 - \\alpha`, none of L lags exceeds the quantile of :math:`\\alpha/2L` (Bonferroni).
    """
    from scipy.fft import irfft, next_fast_len, rfft
    from scipy.special import ndtri

    if residuals.samples_per_window < LEAST_SAMPLES:
        return 0.0, 0.0
    lags = residuals.used.size // 2
    size = next_fast_len(residuals.used.size + lags, real=True)

    def products(values: F8) -> F8:
        return np.asarray(irfft(np.abs(rfft(values, size)) ** 2, size)[: lags + 1])

    sums, pairs = products(residuals.on_grid), np.rint(products(residuals.used.astype(np.float64)))
    if not sums[0] > 0.0:
        return 0.0, 0.0
    enough = pairs > 0.25 * pairs[0]
    correlation = np.where(enough, sums / np.maximum(pairs, 1.0), 0.0) / (sums[0] / pairs[0])
    if shortest > lags:
        return 0.0, 0.0
    lag = shortest + int(np.argmax(np.abs(correlation[shortest:])))
    white = -float(ndtri(FALSE_ALARM / (2.0 * lags))) / math.sqrt(pairs[lag] or 1.0)
    # With fewer pairs than samples the estimate may exceed 1, which a correlation cannot.
    strongest = max(-1.0, min(float(correlation[lag]), 1.0))
    predictable_m = math.sqrt(abs(strongest) * sums[0] / pairs[0])
    if abs(strongest) <= max(COLOUR, white) or predictable_m < LEAST_SHARE * residuals.amplitude_m:
        return 0.0, 0.0
    return strongest, lag * residuals.interval_s


def _halves(fitted: Fitted, least_windows: int) -> float:
    """Return the difference between the halves, in standard uncertainties; 0 if they are too short."""
    demodulated, damping, phase = fitted.demodulated, fitted.damping, fitted.phase
    if demodulated.t.size < 2 * least_windows:
        return 0.0
    amplitudes = demodulated.amplitude - damping.best.amplitude(demodulated.t - damping.t0)
    phases = demodulated.phase - phase.total(demodulated.t)
    u_phase = np.maximum(np.sqrt(demodulated.covariance[:, 1, 1]), ROUNDING)
    half = demodulated.t.size // 2
    return max(_apart(part[:half], part[-half:]) for part in (amplitudes / damping.scatter.u, phases / u_phase))


def _apart(first: F8, second: F8) -> float:
    """Return the largest difference in level or slope of two halves, over its uncertainty.

    The halves have equal length, and their points have the uncertainty 1.
    """
    n = first.size
    x = np.arange(n) - 0.5 * (n - 1)
    change = second - first
    level = abs(float(change.sum())) / math.sqrt(2.0 * n)
    slope = abs(float(x @ change)) / math.sqrt(2.0 * float(x @ x))
    return max(level, slope)
