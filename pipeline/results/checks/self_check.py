"""Check a record against itself: what the fit leaves, folded by phase and correlated at short lags."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.bench.sensor_filter import SensorFilter
from pipeline.motion.phase import PhaseFit
from pipeline.numerics.quantity import amount, noun, plural
from pipeline.numerics.robust import median
from pipeline.oscillation.condition import Conditioned
from pipeline.oscillation.demodulate import Demodulated, model_error
from pipeline.oscillation.disturbances import Disturbances
from pipeline.results.checks.finding import Checked, Finding, Misfit
from pipeline.track import F8, UNUSABLE

__all__ = ["check_residuals", "holding", "judge_held"]

BINS = 64  # of the phase; the eighth harmonic keeps 0.97 of itself
BLOCKS = 16  # parts of the record that have to agree on a harmonic
HIGHEST = 8
LIKELY_CHANCE = 1e-6  # of a harmonic by chance in white noise
FALL = 1.3  # ratio of the first correlations' distances from 1
UNLIKE = 0.08  # root mean square by which correlations may differ from a filter's
TOLD = 0.002  # of the amplitude: what is smaller enters the uncertainties without a word
ROUGHLY = 0.5  # share by which the loss told by the noise may differ from that of the filter that the scene states
REACH = 0.4  # correlation of neighbours from which on they were smoothed, or noise remembers


def check_residuals(
    conditioned: Conditioned,
    demodulated: Demodulated,
    disturbances: Disturbances,
    phase: PhaseFit,
    u_amplitude: float,
    smoothing: SensorFilter | None = None,
) -> Checked:
    """Return what the residuals say: waves locked to the oscillation, and neighbours that know of each other.

    Parameters
    ----------
    conditioned : Conditioned
        The record as it came.
    demodulated, disturbances, phase
        Outputs of the stages of those names.
    u_amplitude : float
        Standard uncertainty of the amplitude by scatter, m: a smoothing sensor that changes less is no matter.
    smoothing : SensorFilter, optional
        What the scene says of the sensor's filter: of that no warning is due, unless the noise shows another.

    Notes
    -----
    Every window's fit leaves no constant and no first harmonic, so that of a wave of the same shape in every period
    the harmonics from the second on are left: :math:`c_k = 2\\overline{r e^{-ik\\varphi}}`. They are taken in
    sixteen parts of the record; with the mean's square over its variance by the parts' scatter F, a harmonic by
    chance is as likely as :math:`(1 + F/(S - 1))^{-(S - 1)}` (F of 2 and 2(S - 1) degrees of freedom). What the
    constant and the first harmonic took in is of the order of what is left, so the largest value of the folded wave is
    the uncertainty of amplitude and rest position.

    White noise that a sensor smooths over N samples is correlated, :math:`\\rho_l = 1 - l/N` behind a running mean and
    :math:`e^{-l/\\tau}` behind a first-order lag; the motion loses
    :math:`1 - \\sin(N\\omega h/2)/(N\\sin(\\omega h/2))` or :math:`1 - (1 + \\omega^2\\tau^2)^{-1/2}` of its amplitude.
    """
    t, unit = conditioned.track.t, conditioned.track.unit
    used = (demodulated.flags & UNUSABLE) == 0
    used &= np.isfinite(demodulated.residual)
    rows = np.flatnonzero(used)
    seconds = float(t[rows[-1]] - t[rows[0]]) if rows.size else 0.0
    if rows.size < 64 or seconds <= 0.0:
        return Checked()
    residual = demodulated.residual[rows]
    locked = [mode for mode in disturbances.sideways.modes if mode.kind == "harmonic"]
    if disturbances.modelled and locked:
        residual = residual + replace(disturbances.sideways, modes=tuple(locked)).position(t[rows])
    step = seconds / (rows[-1] - rows[0])
    turn = phase.angular_frequency.value * step
    amplitude = float(np.mean(np.abs(demodulated.amplitude)))
    quantum_m = conditioned.quantum_m or 0.0
    found = []
    wave, folded = _fold(residual, phase.total(t[rows]), demodulated.noise_m, turn)
    # Drag bends a sinusoid by itself, and a computed record is exact to its digits only.
    least = median(model_error(demodulated.amplitude, demodulated.decay, demodulated.angular_frequency))
    if folded is not None and wave.peak > max(0.5 * quantum_m, least):
        found.append(_not_sinusoidal(wave, amplitude, seconds, unit))
        residual = residual - folded
    held = holding(conditioned)
    if held > 1:
        found.append(_held(held, step, turn, amplitude, unit))
    elif demodulated.noise_m > least:
        whole = np.zeros(t.size)
        whole[rows] = residual
        smoothed = _smoothed(whole, used, rows.size // demodulated.t.size, step, turn, amplitude, unit)
        if smoothed is not None and not _as_stated(smoothed, smoothing, phase, amplitude, 0.5 * u_amplitude):
            found.append(smoothed)
    return Checked.together(*found)


def _as_stated(
    smoothed: Checked, stated: SensorFilter | None, phase: PhaseFit, amplitude: float, least_m: float
) -> bool:
    """Whether what the noise shows of a filter is what the scene states of it, or is no matter without."""
    loss = smoothed.misfits[0].amplitude_m
    if stated is None:
        return loss <= least_m
    told = amplitude * stated.shown(phase.angular_frequency.value)
    return abs(loss - told) <= max(ROUGHLY * max(loss, told), least_m)


@dataclass(frozen=True, slots=True)
class _Wave:
    """A wave locked to the oscillation.

    Parameters
    ----------
    harmonics : tuple of (int, complex)
        Orders and coefficients, m, of those that stand out.
    folded : (BINS,) float64, m
        Their sum against phase; zero is the far turning point.
    """

    harmonics: tuple[tuple[int, complex], ...]
    folded: F8

    @property
    def peak(self) -> float:
        """Largest value of the wave, m."""
        return float(np.max(np.abs(self.folded)))


def _fold(residual: F8, angle: F8, noise_m: float, turn: float) -> tuple[_Wave, F8 | None]:
    """The harmonics that stand out, and their sum at every sample; None where there are none."""
    turns = angle * (1.0 / (2.0 * math.pi))
    bins = ((turns - np.floor(turns)) * BINS).astype(np.int64)
    np.minimum(bins, BINS - 1, out=bins)
    counts = np.diff(-(-np.arange(BLOCKS + 1) * residual.size // BLOCKS))  # of parts as long as each other
    sums = np.bincount(np.repeat(BINS * np.arange(BLOCKS), counts) + bins, residual, BLOCKS * BINS)
    sums = sums.reshape(BLOCKS, BINS)
    centre = 2.0 * math.pi * (np.arange(BINS) + 0.5) / BINS
    orders = np.arange(2, min(HIGHEST, int(math.pi / turn) - 1) + 1)
    if not orders.size:
        return _Wave((), np.zeros(BINS)), None
    waves = np.exp(-1j * orders[:, None] * centre)
    each = 2.0 * (sums @ waves.T) / counts[:, None]
    mean = each.mean(axis=0)
    scatter = np.sum(np.abs(each - mean) ** 2, axis=0) / (BLOCKS - 1)
    variance = np.maximum(scatter, 4.0 * noise_m**2 / counts.mean()) / BLOCKS
    with np.errstate(divide="ignore", invalid="ignore"):
        f = np.where(variance > 0.0, np.abs(mean) ** 2 / variance, 0.0)
    chance = (1.0 + f / (BLOCKS - 1)) ** (1 - BLOCKS)
    stands = np.flatnonzero(chance < LIKELY_CHANCE)
    harmonics = tuple((int(orders[k]), complex(mean[k])) for k in stands)
    folded = np.real(np.conj(waves[stands]).T @ mean[stands])
    return _Wave(harmonics, folded), folded[bins] if harmonics else None


def _not_sinusoidal(wave: _Wave, amplitude: float, seconds: float, unit: str) -> Checked:
    """What a wave locked to the oscillation does to the estimates, and what it comes from."""
    size = wave.peak
    misfit = Misfit(
        name="model_misfit",
        amplitude_m=size,
        offset_m=size,
        phase_rad=size / amplitude,
        damping_rate=2.0 * size / amplitude / seconds,
    )
    if size < TOLD * amplitude:
        return Checked(misfits=(misfit,))
    power = {k: abs(c) ** 2 for k, c in wave.harmonics}
    even = sum(p for k, p in power.items() if k % 2 == 0) / sum(power.values())
    strongest = max(power, key=lambda k: power[k])
    if even > 0.9 and strongest == 2 and power[2] > 0.95 * sum(power.values()):
        cause = "a scale that is bent, or a spring that goes slack: even harmonics"
    elif even < 0.1:
        cause = "a scale that levels off at both ends, stops at both ends, or a bob that bounces: odd harmonics"
    else:
        near = abs(wave.folded[BINS // 2]) > abs(wave.folded[0])
        end = ("near" if near else "far") if unit == "m" else "lower" if near else "upper"
        cause = (
            f"it is largest towards the {end} turning point: an echo, a plateau or a stop there, "
            "or a spring that goes slack"
        )
    return Checked(
        (
            Finding(
                "not_sinusoidal",
                "warning",
                f"the motion as recorded is no sinusoid: every period differs from one by up to {amount(size, unit)} "
                f"({size / amplitude:.1%} of the amplitude) in the same way. Likely {cause}. Amplitude, rest position "
                "and damping are uncertain by as much; look at the residuals, and at what stands in the beam",
            ),
        ),
        (misfit,),
    )


def holding(conditioned: Conditioned) -> int:
    """Return over how many samples each distance is held; 1 where every sample is one of its own.

    Parameters
    ----------
    conditioned : Conditioned

    Notes
    -----
    Distances in coarse steps repeat too, but change at any row. Those of a sensor slower than the record change at
    every k-th row only.
    """
    y = conditioned.track.y[conditioned.used]
    changes = np.flatnonzero(np.diff(y) != 0.0)
    if not 8 <= changes.size <= 0.6 * y.size:
        return 1
    for k in range(min(int(y.size // 8), 200), 1, -1):
        most = int(np.bincount(changes % k).max())
        # By chance a k-th of the changes, and every one a k-th of a turn: of the right k nearly all.
        if most > 0.9 * changes.size and most > 2.5 * changes.size / k:
            return k
    return 1


def judge_held(count: int, step: float, unit: str) -> Finding:
    """Return what is said of values in ``unit`` that stand over so many samples, ``step`` seconds apart."""
    return Finding(
        "held_samples",
        "warning",
        f"every {noun(unit)} stands {count} times in a row: the sensor measures every {count * step:.3g} s only, and "
        f"its last value stands in between, late by {0.5 * (count - 1) * step:.2g} s on average; what that does to "
        "amplitude and phase is in their uncertainties; record at the sensor's own rate",
    )


def _held(count: int, step: float, turn: float, amplitude: float, unit: str) -> Checked:
    half = 0.5 * count * turn
    loss = half / math.sin(half) - 1.0 if half < 0.5 * math.pi else 1.0
    misfit = Misfit(name="held_samples", amplitude_m=amplitude * loss, phase_rad=0.5 * (count - 1) * turn)
    return Checked((judge_held(count, step, unit),), (misfit,))


def _smoothed(
    whole: F8, used: NDArray[np.bool_], length: int, step: float, turn: float, amplitude: float, unit: str
) -> Checked | None:
    """What a sensor that smooths does to the estimates, if neighbours know of each other as behind one."""
    power = float(whole @ whole)
    mask = used.astype(np.float64)

    def correlation(lag: int) -> float:
        pairs = float(mask[:-lag] @ mask[lag:])
        return float(whole[:-lag] @ whole[lag:]) / power * float(mask.sum()) / max(pairs, 1.0)

    if not power > 0.0 or length < 12 or (first := correlation(1)) < REACH:
        return None
    lags = np.unique(np.geomspace(1.0, max(length / 4.0, 3.0), 8).astype(np.int64))
    seen = np.array([correlation(int(lag)) for lag in lags])
    sizes = np.geomspace(1.5, 0.7 * length, 40)
    (mean_off, mean_size), (lag_off, lag_size) = (
        _nearest(memory, sizes, lags, seen, length, turn) for memory in (_mean_memory, _lag_memory)
    )
    if min(mean_off, lag_off) > UNLIKE:
        return None
    if mean_off < lag_off:
        half = 0.5 * mean_size * turn
        gain, late = math.sin(half) / half, 0.5 * (mean_size - 1.0) * step
        what = f"a running mean or median over {mean_size:.0f} samples"
    else:
        gain, late = 1.0 / math.hypot(1.0, turn * lag_size), math.atan(turn * lag_size) * step / turn
        what = f"a first-order lag of {lag_size * step:.2g} s"
    misfit = Misfit(name="sensor_smoothing", amplitude_m=amplitude * (1.0 / gain - 1.0), phase_rad=late / step * turn)
    finding = Finding(
        "smoothed_sensor",
        "warning",
        f"neighbouring {plural(unit)} know of each other (correlation {first:.2f}) as behind {what}: a sensor or a "
        f"program that smooths like that makes the amplitude too small by {1.0 - gain:.1%} and the motion late by "
        f"{late:.2g} s, which the uncertainties hold; switch the smoothing off, or state it in the "
        "scene ([sensor] mean_samples, median_samples or lag_s), and the numbers are corrected for it",
    )
    return Checked((finding,), (misfit,))


def _mean_memory(lags: NDArray[np.int64], sizes: F8) -> F8:
    """Correlation of white noise behind a running mean of so many samples."""
    return np.asarray(np.maximum(1.0 - lags / sizes[:, None], 0.0))


def _lag_memory(lags: NDArray[np.int64], sizes: F8) -> F8:
    """Correlation of white noise behind a first-order lag of so many samples."""
    return np.asarray(np.exp(-lags / sizes[:, None]))


def _nearest(
    memory: Callable[[NDArray[np.int64], F8], F8],
    sizes: F8,
    lags: NDArray[np.int64],
    seen: F8,
    length: int,
    turn: float,
) -> tuple[float, float]:
    """How far the nearest filter's correlations are from those seen, and its size in samples.

    Of noise with a memory a window's fit of a constant and a sinusoid takes along more than of white noise: the share
    :math:`\\sum_l (1 - |l|/L) \\rho_l (1 + 2 \\cos \\omega l)/L` of its variance, L samples a window.
    """
    every = np.arange(length)
    taper = (1.0 - every / length) * (2.0 - (every == 0)) / length
    remembered = memory(every, sizes) * taper
    constant, wave = remembered.sum(axis=1), 2.0 * (remembered @ np.cos(turn * every))
    taken = constant[:, None] + wave[:, None] * np.cos(turn * lags)
    kept = np.maximum(1.0 - constant - wave, 0.02)
    expected = (memory(lags, sizes) - taken) / kept[:, None]
    away = np.sqrt(np.mean((expected - seen) ** 2, axis=1))
    best = int(np.argmin(away))
    # White noise beside whatever the model leaves falls at once from 1, which no filter's memory does.
    fall = (1.0 - seen[0]) / (1.0 - expected[best, 0])
    return (float(away[best]) if 1.0 / FALL < fall < FALL else math.inf), float(sizes[best])
