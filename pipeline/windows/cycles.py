"""Cycles: whether there is an oscillation, its frequency, and where each window of whole periods begins."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.notice import Refusal
from pipeline.numerics.levels import IMPROBABLE, MISFIT, NEGLIGIBLE, OUTLIER
from pipeline.numerics.robust import mad_sigma, median
from pipeline.samples.condition import GAP, Samples
from pipeline.track import F8
from pipeline.windows.sinusoids import LEAST_SAMPLES

# Periods below which the line's negative-frequency image shifts the spectrum's peak: measured on sines of any phase, by
# up to 8 % at two periods, 1 % at three and 0.05 % at four.
FEW_PERIODS = 4.5
# Highest frequency that is sought at uneven times, over their mean rate; a search up to it takes as long as an FFT of
# sixteen times as many values. With 8, nothing changes, as measured by `python -m tests.golden --every 3`.
BEYOND = 4.0
# Maximum number of windows; longer records have longer windows, not more of them. An analysis of 10,000 windows takes
# 0.6 s, measured on 260,000 samples.
MOST_WINDOWS = 20_000


@dataclass(frozen=True, slots=True, eq=False)
class Cycles:
    """Initial values for the oscillation."""

    frequency_hz: float  # frequency of the spectrum's peak, accurate to a few thousandths
    count: float  # number of periods in the record
    bounds: NDArray[np.int64]  # (w + 1,), sample indices at which the windows begin, and the end of the last window
    periods: int = 1  # number of periods in a window


def find_cycles(samples: Samples) -> Cycles | Refusal:
    """Find the oscillation's frequency and slice the record into windows of one period or, with noise, several.

    The latter states the reason: nothing moves, no peak exceeds the noise, or the record spans under 1.5 periods.

    The spectrum is a Hann-windowed, zero-padded periodogram of the detrended record. Straight lines bridge flagged
    samples; where holes make up more than a tenth of the record, the mean fills them. The peak is interpolated by a
    parabola through the logarithms [1]_. For white noise the ratio of a bin to the mean is exponentially distributed,
    so the largest of n exceeds :math:`\\ln(n/\\alpha)` with probability :math:`\\alpha`. If no line is found,
    the search is repeated without the Hann window, which costs 1.8 dB. Below 4.5 periods the peak is off by up to a
    tenth. There the frequency is the one at which the residual of a sinusoid with an offset is smallest.

    The amplitude of a window of N samples has the standard uncertainty :math:`u = \\sqrt{2/N}\\,\\sigma`, its phase
    :math:`u/A`. The window spans as many periods as it needs for twice the fewest samples of a fit and for an amplitude
    of five u, at which the phase is known to 0.2 rad.

    .. [1] M. Gasior, J. L. Gonzalez, "Improving FFT frequency measurement resolution by parabolic and Gaussian
       spectrum interpolation", AIP Conf. Proc. 732 (2004) 276, doi:10.1063/1.1831158.
    """
    track, used = samples.track, samples.used
    t, y = track.t[used], track.y[used]
    low, high = float(y.min()), float(y.max())
    spread = high - low
    resolution = samples.quantum or 0.0
    if spread <= max(3.0 * resolution, 1e-12 * max(high, -low)):
        return Refusal("still", {"spread_m": spread, "level_m": median(y)})
    line = _uneven_line(t, y) or _spectral_line(t, y, track.t, track.rate_hz)
    if line is None:
        middle = median(y)
        if mad_sigma(y - middle) <= MISFIT * samples.noise:
            return Refusal("steady", {"level_m": middle})
        return Refusal("no_line")
    if isinstance(line, Refusal):
        return line
    frequency_hz, amplitude = line
    duration_s = float(t[-1] - t[0]) + 1.0 / track.rate_hz
    if duration_s * frequency_hz < FEW_PERIODS:
        frequency_hz = _least_left(t, y, frequency_hz)
    count = duration_s * frequency_hz
    if count < 1.5:
        return Refusal("few_periods", {"periods": count})
    needed = max(2 * LEAST_SAMPLES, 2.0 * (OUTLIER * samples.noise / max(amplitude, 1e-300)) ** 2)
    periods = max(1, math.ceil(needed * frequency_hz / track.rate_hz), math.ceil(count / MOST_WINDOWS))
    periods = min(periods, max(1, int(count)))
    return Cycles(frequency_hz, count, _bounds(track.t, used, frequency_hz, track.rate_hz, periods), periods)


def _spectral_line(t: F8, y: F8, recorded: F8, rate_hz: float) -> tuple[float, float] | Refusal | None:
    """Return the frequency, Hz, and mean amplitude, m, of the strongest line; None if it may be noise."""
    n = max(round(float(t[-1] - t[0]) * rate_hz) + 1, 8)
    if n > 50 * t.size:
        return Refusal("thin", {"samples": float(t.size), "intervals": float(n)})
    ordinal = np.arange(n, dtype=np.float64)
    grid = t[0] + ordinal / rate_hz
    # Times that are equally spaced except for rounding need no interpolation.
    regular = t.size == n and float(np.abs(t - grid).max()) <= 1e-9 / rate_hz
    values = y if regular else _bridged(grid, t, y, recorded, GAP / rate_hz)
    centred = ordinal - 0.5 * (n - 1)
    values = values - values.sum() / n
    values -= centred * (float(centred @ values) / float(centred @ centred))
    threshold = math.log(n / IMPROBABLE)
    # Without the Hann window lines are narrow and may be lost between two bins, so the bins must be closer.
    for taper, finer in ((np.hanning, 1), (np.ones, 4)):
        window = taper(n)
        frequency_hz, power, ratio = _peak(values * window, rate_hz, finer)
        if ratio >= threshold:
            return frequency_hz, 2.0 * math.sqrt(power) / float(window.sum())
    return None


def uneven_spectrum(t: F8, values: F8) -> tuple[float, NDArray[np.complex128]]:
    """Return the spacing, Hz, and the spectrum of values (n,) at uneven times, far beyond half of their mean rate.

    Each value counts at the nearest point of a grid that is much finer than the mean interval, which turns the phase of
    the highest frequency by an eighth of a turn at most.
    """
    fine_hz = 4.0 * BEYOND * (t.size - 1) / float(t[-1] - t[0])
    index = np.round((t - t[0]) * fine_hz).astype(np.int64)
    size = 2 << int(index[-1]).bit_length()
    return fine_hz / size, np.fft.rfft(np.bincount(index, values, size))[: size // 4]


def _uneven_line(t: F8, y: F8) -> tuple[float, float] | None:
    """Return frequency and mean amplitude of the strongest line if it is above half of the mean rate.

    None if the times are even or have aliases, or if the line may be noise.
    """
    steps = np.diff(t)
    if float(np.std(steps)) < NEGLIGIBLE * float(np.mean(steps)) or aliased(t):
        return None
    spacing, line = uneven_spectrum(t, y - y.mean())
    power = np.abs(line) ** 2
    first = math.ceil(0.5 * (t.size - 1) / float(t[-1] - t[0]) / spacing)
    k = first + int(np.argmax(power[first:]))
    if power[k] < max(math.log(power.size / IMPROBABLE) * float(power.mean()), float(power[:first].max())):
        return None
    return k * spacing, 2.0 * math.sqrt(float(power[k])) / t.size


def aliased(t: F8) -> bool:
    """Return whether a line at another frequency, a few mean rates away at most, looks much like one at the times (n,).

    The other one explains the square of the spectral window as a share of the variance; a half is much.
    """
    spacing, line = uneven_spectrum(t, np.ones(t.size))
    own = math.ceil(2.0 / (spacing * float(t[-1] - t[0])))
    return bool(np.max(np.abs(line[own:]), initial=0.0) ** 2 > 0.5 * t.size**2)


def _bridged(grid: F8, t: F8, y: F8, recorded: F8, hole_s: float) -> F8:
    """Interpolate samples linearly at the times of a grid; if holes are a large part, fill them with the mean."""
    values = np.asarray(np.interp(grid, t, y))
    latest = np.maximum.accumulate(recorded[np.isfinite(recorded)])
    seconds = float(latest[-1] - latest[0])
    # Rows without a usable sample form a hole only where they last longer than the gaps that recur every period.
    for times, longest in ((latest, hole_s), (np.maximum.accumulate(t), max(hole_s, NEGLIGIBLE * seconds))):
        step = np.diff(times)
        if float(step[step > longest].sum()) > NEGLIGIBLE * seconds:
            before = np.searchsorted(times, grid, side="right") - 1
            values[np.append(step > longest, False)[before]] = y.mean()
    return values


def _peak(values: F8, rate_hz: float, finer: int) -> tuple[float, float, float]:
    """Return the frequency, Hz, and power of the highest peak, and its ratio to the noise floor."""
    n = values.size
    size = finer << (n - 1).bit_length()
    line = np.fft.rfft(values, size)
    power = line.real**2 + line.imag**2
    least = max(1, math.floor(size / n))  # slower than one period per record is drift
    k = least + int(np.argmax(power[least:-1]))
    # The noise floor is estimated outside the peak's neighbourhood.
    reach = 4 * math.ceil(size / n)
    below, above = power[least : max(k - reach, least)], power[k + reach :]
    floor = float(below.sum() + above.sum()) / max(below.size + above.size, 1)
    left, mid, right = (math.log(max(value, 1e-300)) for value in power[k - 1 : k + 2].tolist())
    curvature = left - 2.0 * mid + right
    shift = 0.5 * (left - right) / curvature if curvature < 0 else 0.0
    ratio = float(power[k]) / floor if floor > 0 else math.inf
    return float((k + shift) * rate_hz / size), float(power[k]), ratio


def _least_left(t: F8, y: F8, about_hz: float) -> float:
    """Refine a rough frequency for a record of a few periods by least squares of an offset and a sinusoid."""
    size = max(t.size // 400, 1)
    whole = t.size - t.size % size
    tau = t[:whole].reshape(-1, size).mean(axis=1)
    tau -= tau.mean()
    values = np.median(y[:whole].reshape(-1, size), axis=1)
    values -= values.mean()
    low, high = 0.6, 1.6
    for _ in range(3):
        trial_hz = about_hz * np.linspace(low, high, 41)
        angle = 2.0 * np.pi * trial_hz[:, None] * tau
        columns = np.stack([np.cos(angle), np.sin(angle), np.ones_like(angle)], axis=1)
        normal = columns @ columns.transpose(0, 2, 1)
        normal += 1e-9 * tau.size * np.eye(3)
        right = columns @ values
        explained = np.einsum("fi,fi->f", right, np.linalg.solve(normal, right[:, :, None])[:, :, 0])
        about_hz, step = float(trial_hz[np.argmax(explained)]), (high - low) / 40.0
        low, high = 1.0 - 2.0 * step, 1.0 + 2.0 * step
    return about_hz


def _bounds(t: F8, used: NDArray[np.bool_], frequency_hz: float, rate_hz: float, periods: int) -> NDArray[np.int64]:
    first, last = int(used.argmax()), used.size - 1 - int(used[::-1].argmax())
    duration_s = float(t[last] - t[first]) + 1.0 / rate_hz
    windows = max(1, int(duration_s * frequency_hz / periods + 1e-6))
    edges = t[first] + duration_s * np.arange(windows + 1) / windows - 0.5 / rate_hz
    return cut(t, edges, last + 1)


def cut(recorded: F8, edges: F8, end: int) -> NDArray[np.int64]:
    """Return the indices of the samples at which windows with these edges, s, begin, and that of their end."""
    # The latest time so far is monotone even where single times run backward.
    latest = np.maximum.accumulate(np.where(np.isfinite(recorded), recorded, -np.inf))
    bounds = np.append(np.searchsorted(latest, edges[:-1]), end).astype(np.int64)
    return np.asarray(bounds[np.concatenate([[True], bounds[1:] > bounds[:-1]])])
