"""Sensor: whether neighbouring samples are alike, because readings are held or smoothed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.bench.sensor_filter import SensorFilter
from pipeline.checks.misfit import Misfit
from pipeline.checks.residuals import Residuals
from pipeline.numerics.regression import correlation_length
from pipeline.samples.condition import Conditioned
from pipeline.track import F8

ALIKE = 0.4  # correlation of neighbouring residuals that shows a filter: a running mean over two samples gives 0.5
STEADY = 2.0  # maximum ratio of the covariances in the halves: noise is constant, residuals of the motion decay
EQUAL = 0.4  # share of neighbours with the same value above which readings are held: over two samples it is a half
LINES = 3.6  # twice the samples per bend above which readings are joined by lines: noise bends nearly every sample


@dataclass(frozen=True, slots=True)
class Smoothing:
    """A sensor whose neighbouring samples are alike over a number of samples."""

    correlation: float
    samples: float
    loss: float
    late_s: float
    misfit: Misfit


def held_count(conditioned: Conditioned) -> int:
    """Return the number of samples over which each reading is held; 1 if every sample is new.

    Readings in coarse steps repeat too, but new ones have values that occurred before. Readings at rest repeat for
    longer than others.
    """
    y = conditioned.track.y[conditioned.used]
    changes = np.flatnonzero(np.diff(y))
    if not 8 <= changes.size <= (1.0 - EQUAL) * y.size or np.unique(y).size < 0.5 * changes.size:
        return 1
    runs = np.diff(changes)
    return round(y.size / changes.size) if np.quantile(runs, 0.95) <= np.median(runs) + 1.0 else 1


def held(conditioned: Conditioned, residuals: Residuals) -> Misfit | None:
    """Return the effect of readings that are held over N samples, or joined by straight lines; None without either.

    Holding acts as one running mean over N samples, joining as two without delay.
    """
    turn, count, late = residuals.radians_per_sample, float(held_count(conditioned)), 1.0
    if count == 1.0:
        y = conditioned.track.y[conditioned.used]
        rounding = max(2.02 * (conditioned.quantum_m or 0.0), 1e-12 * float(np.ptp(y)))
        # A reading between two samples bends the line at both.
        count, late = 2.0 / max(float(np.mean(np.abs(np.diff(y, 2)) > rounding)), 1e-3), 0.0
        if count < LINES or rounding > 1.1 * residuals.noise_m:
            return None
    loss = min((2.0 - late) * (count * turn) ** 2 / 24.0, 1.0)
    amplitude_m, phase_rad = residuals.amplitude_m * loss, late * 0.5 * (count - 1.0) * turn
    return Misfit(name="held_samples", amplitude_m=amplitude_m, phase_rad=phase_rad)


def find_smoothing(residuals: Residuals, u_amplitude_m: float, stated: SensorFilter | None = None) -> Smoothing | None:
    """Return how far neighbouring samples are alike; None if they are not, or if that affects no result.

    A running mean over N samples correlates white noise over N samples, :math:`1 + 2\\sum\\rho_l = N`, takes
    :math:`(N\\omega h)^2/24` of the amplitude and is :math:`Nh/2` late. A first-order lag with the same sum takes
    three times as much and is as late. The correlations do not tell which it is, so the larger loss is taken. A filter
    in the scene may explain a quarter of it.
    """
    whole, mask = residuals.on_grid, residuals.used.astype(np.float64)
    halves = slice(whole.size // 2), slice(whole.size // 2, None)
    first, *each = (_neighbours(whole[rows], mask[rows]) for rows in (slice(None), *halves))
    variance = float(whole @ whole) / max(float(mask.sum()), 1.0)
    if not (variance > 0.0 and first > ALIKE * variance and 0.0 < max(each) < STEADY * min(each)):
        return None
    count, turn = correlation_length(whole), residuals.radians_per_sample
    # The fit of a window has taken away three of its L/N independent values.
    count /= max(1.0 - 3.0 * count / residuals.samples_per_window, 0.25)
    loss = min((count * turn) ** 2 / 8.0, 1.0)
    expected = 0.0 if stated is None else 1.0 - stated.gain(turn / residuals.interval_s)
    if loss * residuals.amplitude_m < 0.5 * u_amplitude_m or loss < 4.0 * expected:
        return None
    misfit = Misfit(
        name="sensor_smoothing", amplitude_m=residuals.amplitude_m * loss, phase_rad=0.5 * (count - 1.0) * turn
    )
    return Smoothing(first / variance, count, loss, 0.5 * (count - 1.0) * residuals.interval_s, misfit)


def _neighbours(values: F8, used: F8) -> float:
    """Return the covariance of neighbouring samples; 0 without any."""
    return float(values[:-1] @ values[1:]) / max(float(used[:-1] @ used[1:]), 1.0)
