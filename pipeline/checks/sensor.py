"""The sensor: whether neighbouring samples are alike, because readings are held or smoothed."""

from __future__ import annotations

import math

import numpy as np

from pipeline.checks.residual import Misfit, Outcome, Residual
from pipeline.numerics.regression import correlation_length
from pipeline.samples.condition import Samples
from pipeline.track import F8

# Correlation of neighbouring residuals that shows a filter. A running mean over two samples gives 0.5; white noise of
# 80 samples exceeds 0.4 with a probability of 2e-4.
ALIKE = 0.4
# Maximum ratio of the covariances in the halves: noise is constant, residuals of the motion decay. Without it ten
# unfiltered recordings appear filtered, as measured by `python -m tests.golden`.
STEADY = 2.0
# Minimum fall of the correlation from one sample to the next, over the mean fall within the correlation length: 1 for a
# running mean, 2 for a lag, and 0 for a curve that is smooth by itself, as measured in `python -m tests.golden --only
# ubsuny`.
CUSP = 0.5
# Samples per bend, over those of white noise, above which readings are joined by lines: two if every other one is, and
# 1.0 for white noise. All records of `pytest tests/trials/test_sensor_causes.py` that are joined are above it.
LINES = 1.8


def held_count(samples: Samples) -> int:
    """Return the number of samples over which each reading is held; 1 if every sample is new.

    Readings in coarse steps are repeated too, but they change at any row. Held ones change only at every k-th row.
    """
    y = samples.track.y[samples.used]
    changes = np.flatnonzero(np.diff(y))
    if not 8 <= changes.size <= 0.6 * y.size:
        return 1
    for k in range(min(y.size // 8, 200), 1, -1):
        most = int(np.bincount(changes % k).max())
        # By chance, each row of a cycle has a k-th of the changes; with the correct k, one row has nearly all of them.
        if most > 0.9 * changes.size and most > 2.5 * changes.size / k:
            return k
    return 1


def held_numbers(count: int, step_s: float) -> dict[str, float | None]:
    """Return how often a sensor slower than its recording repeats each value; 1 means that they are joined by lines."""
    if count == 1:
        return {}
    return {"count": count, "interval_s": count * step_s, "late_s": 0.5 * step_s * (count - 1)}


def held(residual: Residual) -> Outcome | None:
    """Test for readings that are held over N samples, or joined by straight lines.

    Holding acts as one running mean over N samples, joining as two without delay.
    """
    if not residual.enough:
        return None
    samples, turn, late = residual.samples, residual.turn, 1.0
    repeats = held_count(samples)
    count = float(repeats)
    if repeats == 1:
        y = samples.track.y[samples.used]
        rounding = max(2.02 * (samples.quantum or 0.0), 1e-12 * float(np.ptp(y)))
        # White noise of deviation s bends the line by sqrt(6) s, and by more than x at a share erfc(x/(sqrt(12) s)).
        bend = math.sqrt(6.0) * max(residual.noise, 1e-300)
        white = math.erfc(rounding / (math.sqrt(2.0) * bend))
        share = max(float(np.mean(np.abs(np.diff(y, 2)) > rounding)), 1e-3)
        if rounding > bend or share > white / LINES:
            return None
        # A reading between two samples bends the line at both.
        count, late = 2.0 * white / share, 0.0
    loss = min((2.0 - late) * (count * turn) ** 2 / 24.0, 1.0)
    phase = late * 0.5 * (count - 1.0) * turn
    misfit = Misfit("held_samples", {"amplitude": residual.amplitude * loss, "phase": phase})
    return Outcome("held_samples", held_numbers(repeats, residual.step_s), misfit, lags=math.inf)


def smoothed(residual: Residual) -> Outcome | None:
    """Test how far neighbouring samples are alike; None if that affects no result.

    A running mean over N samples correlates white noise over N samples, :math:`1 + 2\\sum\\rho_l = N`, takes
    :math:`(N\\omega h)^2/24` of the amplitude and is :math:`Nh/2` late. A first-order lag with the same sum takes
    three times as much and is as late. The correlations do not tell which it is, so the larger loss is taken. A filter
    in the scene may explain a quarter of it, and a scene that states no filter is believed.

    A filter cannot make more of noise than its own correlation, which falls from the first sample on. Where it does
    not, the residual is not noise that a filter has smoothed, and shows no filter.
    """
    stated = residual.filter
    if stated is not None and stated.mean_samples.value == 1.0 and stated.lag_s.value == 0.0:
        return None
    if not residual.enough or math.isinf(residual.lags) or not residual.noisy:
        return None
    whole, mask = residual.on_grid()
    halves = slice(whole.size // 2), slice(whole.size // 2, None)
    first, *each = (_neighbours(whole[rows], mask[rows]) for rows in (slice(None), *halves))
    variance = float(whole @ whole) / max(float(mask.sum()), 1.0)
    if not (variance > 0.0 and first > ALIKE * variance and 0.0 < max(each) < STEADY * min(each)):
        return None
    count, turn = correlation_length(whole), residual.turn
    if (1.0 - first / variance) * count < CUSP:
        return None
    # The fit of a window has taken away three of its L/N independent values.
    count /= max(1.0 - 3.0 * count / residual.per_window, 0.25)
    loss = min((count * turn) ** 2 / 8.0, 1.0)
    expected = 0.0 if stated is None else 1.0 - stated.gain(turn / residual.step_s)
    u_amplitude = residual.fitted.damping.best.joint["A0"].u
    if loss * residual.amplitude < 0.5 * u_amplitude or loss < 4.0 * expected:
        return None
    late = 0.5 * (count - 1.0)
    misfit = Misfit("sensor_smoothing", {"amplitude": residual.amplitude * loss, "phase": late * turn})
    numbers = {
        "correlation": first / variance,
        "amplitude_loss": loss,
        "late_s": late * residual.step_s,
        "alike_samples": count,
    }
    return Outcome("smoothed_sensor", numbers, misfit, lags=math.ceil(2.0 * count))


def _neighbours(values: F8, used: F8) -> float:
    """Return the covariance of neighbouring samples; 0 without any."""
    return float(values[:-1] @ values[1:]) / max(float(used[:-1] @ used[1:]), 1.0)
