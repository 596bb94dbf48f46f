"""Sensor: whether distances are held over several samples, joined by straight lines, or smoothed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.bench.sensor_filter import SensorFilter
from pipeline.checks.misfit import Misfit
from pipeline.checks.residuals import Residuals
from pipeline.samples.condition import Conditioned
from pipeline.track import F8

__all__ = ["Held", "Params", "Smoothing", "find_held", "find_joined", "find_smoothing", "held_count", "matters"]

EXACT = 1e-12  # rounding error of computed distances, over their range
BESIDE = 4.0  # minimum distance from a spectral line, in bins: twice its half-width with a Hann window


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of :func:`find_smoothing` and :func:`find_joined`.

    Parameters
    ----------
    correlation : float
        Correlation of neighbouring residuals from which a filter is sought: a running mean over two samples gives 0.5.
    steady : float
        Maximum ratio between the covariances of neighbouring residuals in the two halves of the recording. The noise of
        a sensor is constant; residuals of the motion decay with it. After a filter over ten of 1,200 samples the ratio
        scatters by a quarter.
    unlike : float
        Maximum root-mean-square difference between the correlations and those of a filter. The correlations of 1,200
        samples scatter by 0.03.
    fall : float
        Maximum ratio between the decrease of the correlation over the first lag and that of the filter, for a finding
        to name the sensor. White noise added after the filter increases it, and so do other residuals of the model.
    white : float
        Maximum share of the variance in white noise added after the filter, which lowers all correlations alike.
    as_stated : float
        Maximum relative difference between the loss that the residuals show and that of the filter in the scene.
    straight : float
        Minimum share of second differences between the bends that are only rounding errors.
    chance : float
        Probability that bends at random times seem to come at a constant rate.
    """

    correlation: float = 0.4
    steady: float = 2.0
    unlike: float = 0.08
    fall: float = 1.3
    white: float = 0.6
    as_stated: float = 0.5
    straight: float = 0.9
    chance: float = 1e-6


@dataclass(frozen=True, slots=True)
class Held:
    """A sensor slower than its recording.

    Parameters
    ----------
    count : int
        Number of samples with the same distance.
    interval_s : float
        Time from one measurement to the next.
    misfit : Misfit
    """

    count: int
    interval_s: float
    misfit: Misfit


@dataclass(frozen=True, slots=True)
class Smoothing:
    """A sensor that smooths.

    Parameters
    ----------
    correlation : float
        Correlation of neighbouring residuals.
    mean_samples : float
        Width of the running mean, in samples, if it explains the correlations best; otherwise 0.
    lag_s : float
        Time constant of the first-order lag, if it explains the correlations best; otherwise 0.
    joined_samples : float
        Number of samples between readings that are joined by straight lines, if this explains the correlations best;
        otherwise 0.
    loss : float
        Relative loss of amplitude in the filter.
    late_s : float
        Delay of the motion by the filter.
    certain : bool
        Whether the filter alone explains the correlations. If white noise must be added, other causes are possible too,
        so the uncertainties include the filter but no finding names it.
    misfit : Misfit
    """

    correlation: float
    mean_samples: float
    lag_s: float
    joined_samples: float
    loss: float
    late_s: float
    certain: bool
    misfit: Misfit


def held_count(conditioned: Conditioned) -> int:
    """Return the number of samples over which each distance is held; 1 if every sample is new.

    Parameters
    ----------
    conditioned : Conditioned

    Notes
    -----
    Distances in coarse steps are repeated too, but they change at any row. The distances of a sensor slower than the
    recording change only at every k-th row.
    """
    y = conditioned.track.y[conditioned.used]
    changes = np.flatnonzero(np.diff(y) != 0.0)
    if not 8 <= changes.size <= 0.6 * y.size:
        return 1
    for k in range(min(int(y.size // 8), 200), 1, -1):
        most = int(np.bincount(changes % k).max())
        # By chance, each row of a cycle has a k-th of the changes; with the correct k, one row has nearly all of them.
        if most > 0.9 * changes.size and most > 2.5 * changes.size / k:
            return k
    return 1


def find_held(conditioned: Conditioned, residuals: Residuals) -> Held | None:
    """Return the actual rate of a sensor that is slower than the recording; None if it is not slower.

    Parameters
    ----------
    conditioned : Conditioned
    residuals : Residuals

    Notes
    -----
    Holding a reading over k samples acts as a running mean over k samples. The amplitude decreases by
    :math:`1 - \\sin(x)/x` with :math:`x = k\\omega h/2`, and the motion is delayed by :math:`(k - 1)h/2`.
    """
    count = held_count(conditioned)
    if count == 1:
        return None
    turn = residuals.radians_per_sample
    half = 0.5 * count * turn
    loss = half / math.sin(half) - 1.0 if half < 0.5 * math.pi else 1.0
    misfit = Misfit(name="held_samples", amplitude_m=residuals.amplitude_m * loss, phase_rad=0.5 * (count - 1) * turn)
    return Held(count, count * residuals.interval_s, misfit)


def find_joined(conditioned: Conditioned, residuals: Residuals, params: Params | None = None) -> Smoothing | None:
    """Return the interval between readings of a slow sensor that were joined by straight lines; None without any.

    Parameters
    ----------
    conditioned : Conditioned
    residuals : Residuals
    params : Params, optional

    Notes
    -----
    On a straight line, second differences are rounding errors of at most two units of the last digit; the line bends at
    each reading. Each bend is marked, and bends at a constant rate give a line in the spectrum of the marks. The
    highest of n frequencies of random marks exceeds :math:`\\log_2(n/\\alpha)` times the median power with the
    probability :math:`\\alpha`. Multiples of the frequency of the motion are excluded, because larger accelerations
    make more bends. With N samples from reading to reading, the amplitude decreases by :math:`1 - (\\sin x/x)^2`, where
    :math:`x = N\\omega h/2`.
    """
    params = params or Params()
    y = conditioned.track.y
    rounding = 2.0 * max(conditioned.quantum_m or 0.0, EXACT * float(np.ptp(y[conditioned.used])))
    bends = np.abs(np.diff(np.where(conditioned.used, y, np.nan), 2))
    seen = np.isfinite(bends)
    bent = bends[seen] > 1.01 * rounding
    if not bent.any():
        return None
    marks = np.zeros(bends.size)
    marks[seen] = bent - np.mean(bent)
    power = np.abs(np.fft.rfft(marks * np.hanning(marks.size))) ** 2
    turns = np.arange(power.size) * 2.0 * np.pi / (marks.size * residuals.radians_per_sample)
    beside = np.abs(turns - np.round(turns)) > BESIDE * turns[1]
    beside[-1] = False
    if not beside.any():
        return None
    high = beside & (power > np.median(power[beside]) * math.log2(power.size / params.chance))
    if not high.any():
        return None
    # Bends at every N-th sample give equal lines at the rate and at its multiples. The weights, which act as a mean
    # over neighbouring marks, reduce the multiples.
    line = int(np.argmax(high * power * np.cos(0.5 * np.pi * np.arange(power.size) / power.size) ** 4))
    count = marks.size / _between_bins(power, line)
    turned = np.flatnonzero(seen) / count
    from_bend = np.abs((turned - _phase_of(bent, turned) + 0.5) % 1.0 - 0.5) * count
    between = from_bend > 1.0  # a reading between two samples makes a bend at both
    if not (between.any() and np.mean(~bent[between]) > params.straight):
        return None
    half = 0.5 * count * residuals.radians_per_sample
    gain = (math.sin(half) / half) ** 2 if half < 0.5 * math.pi else 0.5
    misfit = Misfit(name="sensor_smoothing", amplitude_m=residuals.amplitude_m * (1.0 / gain - 1.0), phase_rad=0.0)
    correlation = float(_joined_memory(np.ones(1, np.int64), np.array([count]))[0, 0])
    return Smoothing(correlation, 0.0, 0.0, count, 1.0 - gain, 0.0, True, misfit)


def _between_bins(power: F8, line: int) -> float:
    """Return the position of the maximum of a line, in bins of a spectrum with a Hann window.

    Notes
    -----
    If the amplitude of the higher neighbour is a times that of the highest bin, the line is (2a - 1)/(a + 1) bins
    towards this neighbour.
    """
    side = 1 if power[line + 1] > power[line - 1] else -1
    ratio = math.sqrt(float(power[line + side] / power[line]))
    return line + side * (2.0 * ratio - 1.0) / (ratio + 1.0)


def _phase_of(marks: NDArray[np.bool_], turned: F8) -> float:
    """Return the mean phase of the marks, in turns; ``turned`` contains the phases of all samples."""
    return float(np.angle(np.sum(np.exp(2j * np.pi * turned[marks])))) / (2.0 * math.pi)


def matters(
    found: Smoothing,
    residuals: Residuals,
    u_amplitude_m: float,
    stated: SensorFilter | None = None,
    params: Params | None = None,
) -> bool:
    """Return whether a filter reduces the amplitude significantly and is not the filter that the scene states.

    Parameters
    ----------
    found : Smoothing
    residuals : Residuals
    u_amplitude_m : float
        Standard uncertainty of the amplitude, m: a loss of less than half of it is ignored.
    stated : SensorFilter, optional
        The filter in the scene.
    params : Params, optional
    """
    params = params or Params()
    loss_m, least_m = found.misfit.amplitude_m, 0.5 * u_amplitude_m
    if stated is None:
        return loss_m > least_m
    expected_m = residuals.amplitude_m * stated.shown(residuals.radians_per_sample / residuals.interval_s)
    return abs(loss_m - expected_m) > max(params.as_stated * max(loss_m, expected_m), least_m)


def find_smoothing(residuals: Residuals, params: Params | None = None) -> Smoothing | None:
    """Return the filter whose correlations agree with those of the residuals; None if none does.

    Parameters
    ----------
    residuals : Residuals
    params : Params, optional

    Notes
    -----
    White noise smoothed by a sensor is correlated: :math:`\\rho_l = 1 - l/N` after a running mean over N samples, and
    :math:`\\rho_l = e^{-l/\\tau}` after a first-order lag of :math:`\\tau` samples. The amplitude decreases by
    :math:`1 - \\sin x/x` with :math:`x = N\\omega h/2`, or by :math:`1 - (1 + \\omega^2\\tau^2h^2)^{-1/2}`. If readings
    N samples apart are joined by straight lines, the correlation is a cubic B-spline of width 4N, and the amplitude
    decreases by :math:`1 - (\\sin x/x)^2`. White noise added after the filter multiplies all correlations by one
    factor, which is also fitted.
    """
    params = params or Params()
    whole, turn, step = residuals.on_grid, residuals.radians_per_sample, residuals.interval_s
    length = residuals.samples_per_window
    mask = residuals.used.astype(np.float64)
    if length < 12 or not whole.any():
        return None

    def covariance(lag: int, rows: slice = slice(None)) -> float:
        values, used = whole[rows], mask[rows]
        return float(values[:-lag] @ values[lag:]) / max(float(used[:-lag] @ used[lag:]), 1.0)

    variance = float(whole @ whole) / float(mask.sum())
    if (first := covariance(1) / variance) < params.correlation:
        return None
    halves = [covariance(1, rows) for rows in (slice(whole.size // 2), slice(whole.size // 2, None))]
    if not 0.0 < max(halves) < params.steady * min(halves):
        return None
    lags = np.unique(np.geomspace(1.0, max(length / 4.0, 3.0), 8).astype(np.int64))
    seen = np.array([covariance(int(lag)) / variance for lag in lags])
    sizes = np.geomspace(1.5, 0.7 * length, 40)
    (mean_off, mean_size, mean_fall), (lag_off, lag_size, lag_fall), (joined_off, joined_size, joined_fall) = (
        _nearest(memory, sizes, lags, seen, length, turn, params.white)
        for memory in (_mean_memory, _lag_memory, _joined_memory)
    )
    nearest = min(mean_off, lag_off, joined_off)
    if nearest > params.unlike:
        return None
    mean_samples = lag_s = joined_samples = 0.0
    fall = joined_fall
    if mean_off == nearest:
        half = 0.5 * mean_size * turn
        fall = mean_fall
        gain, late_s, mean_samples = math.sin(half) / half, 0.5 * (mean_size - 1.0) * step, mean_size
    elif lag_off == nearest:
        gain, late_s = 1.0 / math.hypot(1.0, turn * lag_size), math.atan(turn * lag_size) * step / turn
        lag_s, fall = lag_size * step, lag_fall
    else:
        half = 0.5 * joined_size * turn
        gain, late_s, joined_samples = (math.sin(half) / half) ** 2, 0.0, joined_size
    misfit = Misfit(
        name="sensor_smoothing",
        amplitude_m=residuals.amplitude_m * (1.0 / gain - 1.0),
        phase_rad=late_s / step * turn,
    )
    return Smoothing(
        first, mean_samples, lag_s, joined_samples, 1.0 - gain, late_s, 1.0 / params.fall < fall < params.fall, misfit
    )


def _mean_memory(lags: NDArray[np.int64], sizes: F8) -> F8:
    """Return the correlation of white noise after a running mean over ``sizes`` samples."""
    return np.asarray(np.maximum(1.0 - lags / sizes[:, None], 0.0))


def _lag_memory(lags: NDArray[np.int64], sizes: F8) -> F8:
    """Return the correlation of white noise after a first-order lag whose time constant is ``sizes`` samples."""
    return np.asarray(np.exp(-lags / sizes[:, None]))


def _joined_memory(lags: NDArray[np.int64], sizes: F8) -> F8:
    """Return the mean correlation of white noise that is interpolated linearly over ``sizes`` samples."""
    u = lags / sizes[:, None]
    near, far = 1.0 - 1.5 * u**2 + 0.75 * u**3, 0.25 * (2.0 - u) ** 3
    return np.asarray(np.where(u < 1.0, near, np.where(u < 2.0, far, 0.0)))


def _nearest(
    memory: Callable[[NDArray[np.int64], F8], F8],
    sizes: F8,
    lags: NDArray[np.int64],
    seen: F8,
    length: int,
    turn: float,
    most_white: float,
) -> tuple[float, float, float]:
    """Return the misfit of the nearest filter's correlations, the filter's size, and a ratio of decreases.

    The misfit is the root-mean-square difference from the observed correlations. The size is in samples. The ratio is
    the observed decrease of the correlation over the first lag, over that for the filter.

    The window's fit of a constant and a sinusoid removes more of correlated noise than of white noise: the share
    :math:`\\sum_l (1 - |l|/L) \\rho_l (1 + 2 \\cos \\omega l)/L` of its variance, for L samples in a window.
    """
    every = np.arange(length)
    taper = (1.0 - every / length) * (2.0 - (every == 0)) / length
    remembered = memory(every, sizes) * taper
    constant, wave = remembered.sum(axis=1), 2.0 * (remembered @ np.cos(turn * every))
    taken = constant[:, None] + wave[:, None] * np.cos(turn * lags)
    kept = np.maximum(1.0 - constant - wave, 0.02)
    expected = (memory(lags, sizes) - taken) / kept[:, None]
    factor = np.sum(expected * seen, axis=1) / np.maximum(np.sum(expected**2, axis=1), 1e-300)
    factor = np.clip(factor, 1.0 - most_white, 1.0)
    away = np.sqrt(np.mean((factor[:, None] * expected - seen) ** 2, axis=1))
    best = int(np.argmin(away))
    fall = (1.0 - float(seen[0])) / (1.0 - float(expected[best, 0]))
    return float(away[best]), float(sizes[best]), fall
