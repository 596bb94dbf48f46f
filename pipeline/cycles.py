"""Cycles: is there an oscillation, at which frequency, and where does each window of one period begin."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.condition import Conditioned
from pipeline.track import F8

__all__ = ["Cycles", "NoOscillation", "Params", "find_cycles"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of :func:`find_cycles`.

    Parameters
    ----------
    samples_per_window : int
        Fewest samples that a window may hold; windows span as many whole periods as that takes.
    false_alarm : float
        Probability that white noise alone passes for an oscillation.
    """

    samples_per_window: int = 12
    false_alarm: float = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Cycles:
    """The oscillation's start values.

    Parameters
    ----------
    frequency_hz : float
        From the spectrum's peak, good to a few thousandths.
    count : float
        Periods in the record.
    bounds : (w + 1,) int64
        Sample indices at which the windows begin, and the end of the last.
    crossings_s : (c,) float64, s
        Upward crossings of the mean level, interpolated.
    """

    frequency_hz: float
    count: float
    bounds: NDArray[np.int64]
    crossings_s: F8


@dataclass(frozen=True, slots=True)
class NoOscillation:
    """Why a record is taken to hold no oscillation.

    Parameters
    ----------
    why : str
        One sentence.
    """

    why: str


def find_cycles(conditioned: Conditioned, params: Params | None = None) -> Cycles | NoOscillation:
    """Find the oscillation's frequency and cut the record into windows of one period.

    Parameters
    ----------
    conditioned : Conditioned
    params : Params, optional

    Returns
    -------
    Cycles or NoOscillation
        The latter says why: nothing moves, no peak stands out of the noise, or under 1.5 periods were seen.

    Notes
    -----
    The spectrum is a Hann-windowed, zero-padded periodogram of the detrended record with flagged samples bridged
    by straight lines; the peak is interpolated by a parabola through the logarithms [1]_. For white noise the
    ratio of a bin to the mean is exponentially distributed, so the largest of n exceeds :math:`\\ln(n/\\alpha)` with
    probability :math:`\\alpha`.

    References
    ----------
    .. [1] M. Gasior, J. L. Gonzalez, "Improving FFT frequency measurement resolution by parabolic and Gaussian
       spectrum interpolation", AIP Conf. Proc. 732 (2004) 276, doi:10.1063/1.1831158.
    """
    params = params or Params()
    track, used = conditioned.track, conditioned.used
    t, y = track.t[used], track.y[used]
    spread = float(np.ptp(y))
    resolution = conditioned.quantum_m or 0.0
    if spread <= max(3.0 * resolution, 1e-12 * float(np.max(np.abs(y)))):
        return NoOscillation(
            f"the distance stays within {spread * 1e3:.3g} mm: nothing moves, or the sensor reads one fixed object"
        )
    found = _spectral_peak(t, y, track.rate_hz, params.false_alarm)
    if isinstance(found, NoOscillation):
        return found
    duration_s = float(t[-1] - t[0])
    count = duration_s * found
    if count < 1.5:
        return NoOscillation(f"only {count:.2g} periods were recorded where 1.5 are needed; record longer")
    return Cycles(found, count, _bounds(track.t, used, found, track.rate_hz, params), _crossings(t, y))


def _spectral_peak(t: F8, y: F8, rate_hz: float, false_alarm: float) -> float | NoOscillation:
    n = max(round(float(t[-1] - t[0]) * rate_hz) + 1, 8)
    if n > 50 * t.size:
        return NoOscillation(f"{t.size} samples are spread over {n} sample intervals: too thin to find a period")
    grid = t[0] + np.arange(n) / rate_hz
    values = np.interp(grid, t, y)
    centred = np.arange(n) - 0.5 * (n - 1)
    values = values - values.mean()
    values -= centred * (centred @ values) / (centred @ centred)
    size = 1 << (n - 1).bit_length()
    power = np.abs(np.fft.rfft(values * np.hanning(n), size)) ** 2
    least = max(1, math.floor(size / n))  # slower than one period per record is drift
    k = least + int(np.argmax(power[least:-1]))
    # Half the record's own bins outside the peak's neighbourhood stand for the floor.
    reach = 4 * math.ceil(size / n)
    outside = np.concatenate([power[least : max(k - reach, least)], power[k + reach :]])
    floor = float(np.mean(outside)) if outside.size else 0.0
    if floor > 0 and power[k] / floor < math.log(n / false_alarm):
        return NoOscillation("no line stands out of the spectrum's noise: there is no oscillation to be seen")
    left, mid, right = np.log(np.maximum(power[k - 1 : k + 2], 1e-300))
    curvature = left - 2.0 * mid + right
    shift = 0.5 * (left - right) / curvature if curvature < 0 else 0.0
    return float((k + shift) * rate_hz / size)


def _bounds(t: F8, used: NDArray[np.bool_], frequency_hz: float, rate_hz: float, params: Params) -> NDArray[np.int64]:
    rows = np.flatnonzero(used)
    first, last = int(rows[0]), int(rows[-1])
    periods = max(1, math.ceil(params.samples_per_window * frequency_hz / rate_hz))
    duration_s = float(t[last] - t[first]) + 1.0 / rate_hz
    windows = max(1, int(duration_s * frequency_hz / periods + 1e-6))
    edges = t[first] + duration_s * np.arange(windows + 1) / windows - 0.5 / rate_hz
    # Latest time seen: monotone even where single times run backward.
    latest = np.maximum.accumulate(np.where(np.isfinite(t), t, -np.inf))
    bounds: NDArray[np.int64] = np.searchsorted(latest, edges).astype(np.int64)
    bounds[-1] = last + 1
    return np.unique(bounds)


def _crossings(t: F8, y: F8) -> F8:
    """Interpolated times of upward crossings of the mid level, one per swing (hysteresis of a tenth of it)."""
    low, high = np.quantile(y, (0.02, 0.98))
    level, margin = 0.5 * (low + high), 0.05 * (high - low)
    state = np.where(y > level + margin, 1, np.where(y < level - margin, -1, 0))
    known = np.flatnonzero(state)
    flips = np.flatnonzero((state[known[:-1]] < 0) & (state[known[1:]] > 0))
    a, b = known[flips], known[flips + 1]
    times: F8 = t[a] + (level - y[a]) * (t[b] - t[a]) / (y[b] - y[a])
    return times
