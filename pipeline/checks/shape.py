"""The shape of a period: whether all periods differ from a sinusoid in the same way."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from pipeline.checks.residual import PARTS, Misfit, Outcome, Residual
from pipeline.numerics.levels import IMPROBABLE, NEGLIGIBLE
from pipeline.track import C16, F8

# Highest order of the harmonics that are sought; each further one adds IMPROBABLE to the probability of a false alarm.
HIGHEST = 8
BINS = HIGHEST * HIGHEST  # phase bins per period: the highest harmonic keeps sin(x)/x = 0.97 of its amplitude, x = pi/8
# Minimum share of harmonics in the amplitude for a warning; the uncertainties include smaller ones. Those of a scale
# bent by 1 % reach it, as measured by `python -m tests.trials.troubles --only bent`.
REPORTED = 0.002
CENTRES = math.tau * np.arange(BINS) / BINS + math.pi / BINS


def folded_shape(residual: Residual) -> Outcome | None:
    """Test for a wave that has the same shape in every period.

    The fit of every window removes the constant and the first harmonic. So the residuals contain the harmonics from the
    second on: :math:`c_k = 2\\overline{r e^{-ik\\varphi}}`. The harmonics of a nonlinear scale or spring are
    proportional to the power :math:`A^k` of the amplitude A. They are fitted with the weights :math:`A^k`, and are used
    instead if they are less likely by chance. Harmonics are fitted in S = 16 parts of the run. Let F be the squared
    mean of the parts over its variance from their scatter. The probability of such a harmonic by chance is
    :math:`(1 + F/(S - 1))^{-(S - 1)}`, the F distribution with 2 and 2(S - 1) degrees of freedom.

    The contribution of the wave to the constant and the first harmonic is about as large as the part that remains. So
    the largest value of the wave is the uncertainty of amplitude and rest position. A third harmonic makes the
    uncertainty of the amplitude three times as large, because
    :math:`\\cos^3\\varphi = (3\\cos\\varphi + \\cos 3\\varphi)/4`. If this contribution decays as the square of the
    amplitude, the relative error of the damping rate is twice that of the amplitude.
    """
    if not residual.enough:
        return None
    values, phase, noise, relative = residual.values, residual.phase, residual.noise, residual.relative
    orders = np.arange(2, min(HIGHEST, int(math.pi / residual.turn) - 1) + 1)
    if not orders.size:
        return None
    mean, chance = harmonics(values, phase, noise, orders, None)
    falls = False
    if relative is not None:
        falling = harmonics(values, phase, noise, orders, relative)
        if falls := float(np.min(falling[1])) < float(np.min(chance)):
            mean, chance = falling
    stands = np.flatnonzero(chance < IMPROBABLE)
    each = np.real(mean[stands, None] * np.exp(1j * orders[stands, None] * CENTRES))
    wave = each.sum(axis=0)
    peak = float(np.max(np.abs(wave)))
    if not peak > max(0.5 * (residual.samples.quantum or 0.0), residual.rounding):
        return None
    amplitude, fall = residual.amplitude, 1.0
    if falls and relative is not None:
        amplitude /= float(np.mean(relative))
        fall = max(1.0, -math.log(max(float(relative[-1]), 1e-3)))
    power, order = np.abs(mean[stands]) ** 2, orders[stands]
    moved = peak + 2.0 * float(np.sum(np.sqrt(power[order == 3])))
    share, way = peak / amplitude, _way(power, order, wave)
    sizes = {"damping_rate": 2.0 * moved / amplitude * fall / residual.seconds}
    misfit = Misfit("model_misfit", {"amplitude": moved, "offset": peak, "phase": share, **sizes})
    numbers = None if share < REPORTED else {"peak_m": peak, "share": share, **way}
    bins = _bins(phase)
    explained = np.zeros(bins.size)
    for one, k in zip(each, order.tolist(), strict=True):
        explained += one[bins] if not falls or relative is None else one[bins] * relative**k
    return Outcome("not_sinusoidal", numbers, misfit, explained)


def _bins(phase: F8) -> NDArray[np.int64]:
    """Return the bin of each phase (n,)."""
    turns = phase * (1.0 / (2.0 * math.pi))
    return np.minimum(((turns - np.floor(turns)) * BINS).astype(np.int64), BINS - 1)


def _way(power: F8, order: NDArray[np.int64], wave: F8) -> dict[str, float]:
    """Return the share of even or odd harmonics if nearly all are, or else the end at which the wave is largest."""
    total = float(power.sum())
    even, second = float(power[order % 2 == 0].sum()) / total, float(power[order == 2].sum()) / total
    if even > 1.0 - NEGLIGIBLE and second > 1.0 - 0.5 * NEGLIGIBLE:
        return {"even": even}
    if even < NEGLIGIBLE:
        return {"odd": 1.0 - even}
    return {"near_peak_m" if abs(wave[BINS // 2]) > abs(wave[0]) else "far_peak_m": float(np.max(np.abs(wave)))}


def harmonics(values: F8, phase: F8, noise: float, orders: NDArray[np.int64], relative: F8 | None) -> tuple[C16, F8]:
    """Return harmonics of a phase (o,), steady or proportional to a power of the amplitude, and the chance of each.

    Each harmonic is the weighted mean of least-squares fits to the parts of the run.
    """
    waves, bins = np.exp(-1j * orders[:, None] * CENTRES), _bins(phase)
    each, own = np.zeros((PARTS, orders.size), np.complex128), np.zeros((PARTS, orders.size))
    edges = -(-np.arange(PARTS + 1) * bins.size // PARTS)
    for part, (first, stop) in enumerate(itertools.pairwise(edges.tolist())):
        rows = slice(first, stop)
        weight = np.ones(stop - first) if relative is None else relative[rows] ** (orders[0] - 1)
        for i in range(orders.size):
            if relative is not None:
                weight = weight * relative[rows]
            if relative is not None or i == 0:
                sums = np.bincount(bins[rows], values[rows] * weight, BINS)
            own[part, i] = weight @ weight
            each[part, i] = 2.0 * (waves[i] @ sums) / max(own[part, i], 1e-300)
    share = own / own.sum(axis=0)
    mean = np.sum(share * each, axis=0)
    # Parts in which the harmonic is weak contain little information and have little weight.
    known = 1.0 / np.sum(share**2, axis=0)
    scatter = np.sum(share**2 * np.abs(each - mean) ** 2, axis=0) * known / np.maximum(known - 1.0, 1e-9)
    variance = np.maximum(scatter, 4.0 * noise**2 / own.sum(axis=0))
    judged = (known > 2.0) & (variance > 0.0)
    f = np.abs(mean) ** 2 / np.where(judged, variance, 1.0)
    chance = np.where(judged, (1.0 + f / np.where(judged, known - 1.0, 1.0)) ** (1.0 - known), 1.0)
    return mean, np.asarray(chance)
