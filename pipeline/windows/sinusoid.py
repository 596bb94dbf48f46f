"""Whether a motion whose spectrum has a peak really is an oscillation."""

from __future__ import annotations

import math

import numpy as np

from pipeline.numerics.levels import FEWEST_FOR_CURVE
from pipeline.numerics.quantity import amount, noun
from pipeline.samples.condition import Conditioned
from pipeline.track import UNUSABLE
from pipeline.windows.cycles import NoOscillation
from pipeline.windows.demodulate import Demodulated

MOST_BENT = 0.25  # maximum residual over the amplitude: parabolas leave 0.19, a motion seen mostly as plateaus 0.35
FOLDED = 32  # phase bins per period
ALIKE = 0.25  # maximum share of the residual's variance by which similar periods may differ
WANDERING = 0.3  # maximum residual beyond white noise, over the amplitude


def check_sinusoid(conditioned: Conditioned, demodulated: Demodulated) -> NoOscillation | None:
    """Return why the motion is no oscillation, although its spectrum has a peak; None if it is one.

    A step or a ramp has a peak in its spectrum too.
    """
    most = demodulated.amplitude.size * 9 // 10
    size = float(np.partition(demodulated.amplitude, most)[most])
    left, unit = demodulated.noise_m, conditioned.track.unit
    if not size > 1e-12 * float(np.max(np.abs(demodulated.offset))):
        return NoOscillation(f"the {noun(unit)} does not follow the period of its spectrum")
    # Correlated noise, a drift or a random walk makes neighbouring samples more similar than white noise does.
    noise = max(conditioned.noise_m, (conditioned.quantum_m or 0.0) / math.sqrt(12.0))
    # Both noises are estimated from the same n samples. For white noise the ratio of their squares has a variance of
    # 8.5/n. Five standard deviations are allowed: the largest difference in 2,000 records at -10 dB is 4.3.
    chance = 5.0 * math.sqrt(8.5 / max(float(np.sum(demodulated.count)), 1.0))
    excess = math.sqrt(max(left**2 - (1.0 + chance) * noise**2, 0.0))
    if left <= 0.15 * size or (left <= 4.0 * conditioned.noise_m and excess <= WANDERING * size):
        return None
    if left > MOST_BENT * size or not (demodulated.t.size >= FEWEST_FOR_CURVE or _repeats(conditioned, demodulated)):
        return NoOscillation(
            f"the {noun(unit)} changes, but a sinusoid of {amount(size, unit, '.3g')} leaves "
            f"{amount(left, unit, '.3g')}"
        )
    return None


def _repeats(conditioned: Conditioned, demodulated: Demodulated) -> bool:
    """Return whether the residual of the sinusoid is similar in every period: a bob that bounces still oscillates."""
    rows = np.flatnonzero(((demodulated.flags & UNUSABLE) == 0) & np.isfinite(demodulated.residual))
    left = demodulated.residual[rows]
    turns = np.interp(conditioned.track.t[rows], demodulated.t, demodulated.phase) / (2.0 * math.pi)
    bins = ((turns - np.floor(turns)) * FOLDED).astype(np.int64) % FOLDED
    means = np.bincount(bins, left, FOLDED) / np.maximum(np.bincount(bins, minlength=FOLDED), 1)
    return demodulated.t.size >= 4 and float(np.var(left - means[bins])) < ALIKE * float(np.var(left))
