"""Tests that name no cause: does one model describe the whole run?"""

from __future__ import annotations

import math

import numpy as np

from pipeline.checks.residual import Outcome, Residual
from pipeline.numerics.levels import FALSE_ALARM, NOTICEABLE, normal_quantile
from pipeline.numerics.regression import correlation_length
from pipeline.samples.condition import COARSE
from pipeline.track import F8
from pipeline.windows.demodulate import FINEST

# Degree of the polynomials of a slow change: it follows from the four parameters of a smooth curve through a run.
SLOW = 4


def slow_change(residual: Residual) -> Outcome | None:
    """Test a fit to all samples for slow changes of amplitude, phase and rest position that it does not describe.

    A misfit far below the noise of one sample is visible in its order. With the amplitude A and the phase of the fit,
    the residuals are fitted by :math:`\\sum_k P_k(x)(a_k A\\cos\\varphi + b_k A\\sin\\varphi) + c_k P_k(\\tau)`, with
    Legendre polynomials up to degree :data:`SLOW`. Time :math:`\\tau`, and the integral x of :math:`A^2`, of which each
    part of the record contains equal information, are scaled to -1 to 1. The mean square of what this explains, over
    that of the rest, follows the F distribution, because the noise is measured in the rest; its correlation counts.
    """
    from scipy.special import fdtrc

    values, relative, t = residual.values, residual.relative, residual.samples.track.t[residual.rows]
    coarse = (residual.samples.quantum or 0.0) / COARSE
    if relative is None or not residual.enough or residual.noise <= max(FINEST * residual.amplitude, coarse):
        return None
    scaled = (2.0 * (x - x[0]) / (x[-1] - x[0]) - 1.0 for x in (np.cumsum(relative**2), t))
    moving, still = (np.polynomial.legendre.legvander(x, SLOW) for x in scaled)
    sides = (relative * np.cos(residual.phase), relative * np.sin(residual.phase))
    design = np.concatenate([moving * side[:, None] for side in sides] + [still], axis=1)
    explained = design @ np.linalg.lstsq(design, values, rcond=None)[0]
    rest = values - explained
    count, length = design.shape[1], correlation_length(rest)
    free = (values.size - count) / length
    ratio = float(explained @ explained) / count / (float(rest @ rest) / (values.size - count)) / length
    return Outcome("model_misfit", {"slow_change": ratio}) if fdtrc(count, free, ratio) < FALSE_ALARM else None


def colour(residual: Residual) -> Outcome | None:
    """Test whether more than half of what the whole fit leaves can be predicted from what it left in another period.

    Correlation over less than half a period belongs to the noise. That of n samples of white noise has a standard
    deviation of :math:`n^{-1/2}`: with the probability :math:`1 - \\alpha`, none of L lags exceeds the quantile of
    :math:`\\alpha/2L` (Bonferroni). What is no more than the noise within a period counts if it is noticeable.
    """
    from scipy.fft import irfft, next_fast_len, rfft

    shortest = max(residual.lags, math.pi / residual.turn)
    if not residual.enough or not residual.noisy or shortest > 0.5 * len(residual.samples.track):
        return None
    whole, used = residual.on_grid(of_whole_fit=True)
    lags, first = whole.size // 2, math.ceil(shortest)
    size = next_fast_len(whole.size + lags, real=True)

    def products(values: F8) -> F8:
        return np.asarray(irfft(np.abs(rfft(values, size)) ** 2, size)[: lags + 1])

    sums, pairs = products(whole), np.rint(products(used))
    if not sums[0] > 0.0:
        return None
    enough = pairs > 0.25 * pairs[0]
    correlation = np.where(enough, sums / np.maximum(pairs, 1.0), 0.0) / (sums[0] / pairs[0])
    lag = first + int(np.argmax(np.abs(correlation[first:])))
    white = normal_quantile(1.0 - FALSE_ALARM / lags) / math.sqrt(pairs[lag] or 1.0)
    # With fewer pairs than samples the estimate may exceed 1, which a correlation cannot.
    strongest = max(-1.0, min(float(correlation[lag]), 1.0))
    rms = math.sqrt(float(sums[0] / pairs[0]))
    small = rms < residual.noise and math.sqrt(abs(strongest)) * rms < NOTICEABLE * residual.amplitude
    if abs(strongest) <= max(0.5, white) or small:
        return None
    larger = {"rms_m": rms, "noise_m": residual.noise} if rms > residual.noise else {}
    return Outcome("model_misfit", {**larger, "correlation": strongest, "lag_s": lag * residual.step_s})
