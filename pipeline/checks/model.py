"""Tests that name no cause: does one model describe the whole run?"""

from __future__ import annotations

import math

import numpy as np

from pipeline.checks.residual import Outcome, Residual
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


def excess(residual: Residual) -> Outcome | None:
    """Test whether the whole model leaves more than noise."""
    rms_m, noise_m = residual.fitted.waveform.rms_m, residual.noise_m
    if rms_m > EXCESS * max(noise_m, residual.rounding_m):
        return Outcome("model_misfit", {"rms_m": rms_m, "noise_m": noise_m})
    return None


def phases(residual: Residual) -> Outcome | None:
    """Test whether the phases scatter as their noise predicts."""
    phase = residual.fitted.phase
    free = (phase.residual.size - phase.coefficients.size) / phase.correlation
    if free >= 1.0 and phase.reduced_chi2 > chi2_quantile(1.0 - FALSE_ALARM, free) / free:
        chi2 = phase.reduced_chi2
        return Outcome("model_misfit", {"phase_chi2": chi2, "phase_scatter": math.sqrt(chi2)})
    return None


def halves(residual: Residual) -> Outcome | None:
    """Test whether both halves of the run agree with one model.

    The residuals of amplitudes and phases, over their standard uncertainties, are fitted by a straight line in each
    half. If the model is correct, the differences in level and slope are four standard normal numbers, of which the
    largest is tested.
    """
    from scipy.special import ndtri

    fitted = residual.fitted
    windows, damping = fitted.demodulated, fitted.damping
    if windows.t.size < 2 * LEAST_WINDOWS:
        return None
    amplitudes = (windows.amplitude - damping.best.amplitude(windows.t - damping.t0)) / damping.scatter.u
    u_phase = np.maximum(np.sqrt(windows.covariance[:, 1, 1]), ROUNDING)
    half = windows.t.size // 2
    x = np.arange(half) - 0.5 * (half - 1)
    apart = 0.0
    for part in (amplitudes, (windows.phase - fitted.phase.total(windows.t)) / u_phase):
        change = part[-half:] - part[:half]
        level, slope = abs(float(change.sum())) / math.sqrt(half), abs(float(x @ change)) / math.sqrt(float(x @ x))
        apart = max(apart, level / math.sqrt(2.0), slope / math.sqrt(2.0))
    return Outcome("model_misfit", {"halves": apart}) if apart > -float(ndtri(FALSE_ALARM / 8.0)) else None


def colour(residual: Residual) -> Outcome | None:
    """Test whether the residual that no other test explains is white at all lags.

    The correlations of n samples of white noise have a standard deviation of :math:`n^{-1/2}`. With the probability
    :math:`1 - \\alpha`, none of L lags exceeds the quantile of :math:`\\alpha/2L` (Bonferroni).
    """
    from scipy.fft import irfft, next_fast_len, rfft
    from scipy.special import ndtri

    if not residual.enough or not residual.noisy or residual.per_window < LEAST_SAMPLES:
        return None
    whole, used = residual.on_grid()
    lags, shortest = whole.size // 2, residual.lags
    if shortest > lags:
        return None
    size, first = next_fast_len(whole.size + lags, real=True), int(shortest)

    def products(values: F8) -> F8:
        return np.asarray(irfft(np.abs(rfft(values, size)) ** 2, size)[: lags + 1])

    sums, pairs = products(whole), np.rint(products(used))
    if not sums[0] > 0.0:
        return None
    enough = pairs > 0.25 * pairs[0]
    correlation = np.where(enough, sums / np.maximum(pairs, 1.0), 0.0) / (sums[0] / pairs[0])
    lag = first + int(np.argmax(np.abs(correlation[first:])))
    white = -float(ndtri(FALSE_ALARM / (2.0 * lags))) / math.sqrt(pairs[lag] or 1.0)
    # With fewer pairs than samples the estimate may exceed 1, which a correlation cannot.
    strongest = max(-1.0, min(float(correlation[lag]), 1.0))
    predictable_m = math.sqrt(abs(strongest) * sums[0] / pairs[0])
    if abs(strongest) <= max(COLOUR, white) or predictable_m < LEAST_SHARE * residual.amplitude_m:
        return None
    return Outcome("model_misfit", {"correlation": strongest, "lag_s": lag * residual.step_s})
