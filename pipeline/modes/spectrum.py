"""Lines: single frequencies in the residual of a smooth model of an oscillation, at a stated false-alarm rate.

The periodograms of libraries state this rate for white noise only. At a rate of 0.01 their threshold finds a line in
each of 200 records of noise with a correlation of 0.9 from block to block. The search here finds one in at most two of
a hundred records (``tests/trials/test_disturbances.py``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.regression import beyond
from pipeline.numerics.robust import median
from pipeline.track import F8

# Highest order of the autoregression that describes the residual's correlation; with order 1, one of 107 command lines
# of `python -m tests.golden --every 10` has harmonics no more.
AR_ORDER = 4
# Oversampling of the spectrum: between two of its points a line loses at most 2 % of its power under a Hann window
# (F. J. Harris, Proc. IEEE 66 (1978) 51).
OVERSAMPLING = 4
# Independent trials per natural bin, because frequencies between bins are searched too; measured by the rate of false
# alarms (tests/trials/test_disturbances.py).
CONTINUUM = 2.5
NEAREST, FARTHEST = 2, 7  # distances from a line, in natural bins, between which the noise power is measured
# Degree of the polynomials for a line's amplitude and phase while the noise beside it is measured. With 4, two of 234
# recordings change, as measured by `python -m tests.golden --every 3`.
VARYING = 3
FREEDOM = 6.0  # complex degrees of freedom of the noise power; they follow from twelve bins, halved by the taper


@dataclass(frozen=True, slots=True, eq=False)
class Blocks:
    """Means of consecutive samples on an even grid, fine enough for lines at a few times the main frequency."""

    t: F8  # (b,) s, mean times of the samples used, counted from ``origin``; the middle of a block without samples
    y: F8  # (b,) m, mean values; 0 in a block without samples
    weight: F8  # (b,) square root of the number of samples used
    step: float  # s, length of a block
    samples: float  # number of samples per full block
    origin: float  # s, start of the first block
    # (b,) Hann window times the share of samples used, scaled so that white noise keeps its variance per block.
    taper: F8

    def unweighted(self, rows: F8) -> F8:
        """Divide weighted rows (b,) by the weights; 0 for blocks without samples."""
        return np.divide(rows, self.weight, out=np.zeros_like(rows), where=self.weight > 0)

    @classmethod
    def of(cls, t: F8, y: F8, step: float, rate_hz: float) -> Blocks:
        """Average values y (n,) at times t (n,) over blocks of ``step`` seconds, a whole number of samples each."""
        samples = max(1, round(step * rate_hz))
        step = samples / rate_hz
        origin = float(t[0]) - 0.5 / rate_hz
        index = np.floor((t - origin) / step).astype(np.int64)
        size = int(index.max()) + 1
        count = np.bincount(index, minlength=size).astype(np.float64)
        middle = (np.arange(size) + 0.5) * step
        safe = np.maximum(count, 1.0)
        away = np.bincount(index, weights=t - origin - middle[index], minlength=size) / safe
        mean = np.bincount(index, weights=y, minlength=size) / safe
        weight = np.sqrt(count)
        tapered = np.hanning(size + 2)[1:-1] * weight
        taper = tapered * weight / math.sqrt(samples * float(tapered @ tapered))
        return cls(
            t=middle + away, y=mean, weight=weight, step=step, samples=float(samples), origin=origin, taper=taper
        )

    @property
    def seconds(self) -> float:
        """Length of the record, s."""
        return self.t.size * self.step

    def attenuation(self, frequency_hz: float) -> float:
        """Return the factor by which averaging over a block attenuates a line."""
        x = math.pi * frequency_hz * self.step / self.samples
        return math.sin(self.samples * x) / (self.samples * math.sin(x)) if x > 0 else 1.0


@dataclass(frozen=True, slots=True)
class SearchBand:
    """The frequencies at which a line is searched."""

    low_hz: float
    high_hz: float
    holes: tuple[tuple[float, float], ...]  # centres and half-widths, Hz, of the ranges that the model already covers

    def inside(self, frequency_hz: F8) -> NDArray[np.bool_]:
        """Return for each frequency (k,) whether it belongs to the band."""
        mask = (frequency_hz >= self.low_hz) & (frequency_hz <= self.high_hz)
        for centre, half in self.holes:
            mask &= np.abs(frequency_hz - centre) > half
        return np.asarray(mask)


@dataclass(frozen=True, slots=True)
class Peak:
    """The strongest line of a residual."""

    frequency_hz: float
    density: float  # m^2, variance of the noise of one full block at that frequency
    evidence: float  # half the reduction of chi-square by the line; without a line it is exponentially distributed
    false_alarm: float  # probability that noise produces a line as strong anywhere in the band


def spectrum(blocks: Blocks, y: F8) -> tuple[F8, F8]:
    """Return frequencies (k,), Hz, and power (k,), m^2; white noise has its variance per block as its expectation."""
    size = 1 << (OVERSAMPLING * y.size - 1).bit_length()
    lines = np.fft.rfft(blocks.taper * y, size)
    frequency = np.asarray(np.fft.rfftfreq(size, blocks.step), np.float64)
    return frequency, np.asarray(lines.real**2 + lines.imag**2, np.float64)


def worth_a_look(blocks: Blocks, band: SearchBand, fixed_hz: tuple[float, ...], chance: float) -> bool:
    """Return whether any line could be significant; this quick test spares most records the full search.

    A record passes with half the evidence needed for acceptance, relative to the median density of the band.
    """
    frequency, power = spectrum(blocks, blocks.y)
    inside = band.inside(frequency)
    if np.count_nonzero(inside) < 8:
        return False
    usual = median(power[inside]) / math.log(2.0)
    trials = _trials(inside, float(frequency[1]), blocks)
    fixed = np.min(np.abs(np.subtract.outer(fixed_hz, frequency)), axis=0) <= 1.0 / blocks.seconds
    # The taper reduces a line's power by a third.
    least, least_fixed = (0.5 * evidence_for(chance, n) / 1.5 * usual for n in (trials, float(len(fixed_hz))))
    return bool(np.any(power[inside] > least) or np.any(power[fixed] > least_fixed))


def _trials(inside: NDArray[np.bool_], spacing_hz: float, blocks: Blocks) -> float:
    return max(CONTINUUM * float(np.count_nonzero(inside)) * spacing_hz * blocks.seconds, 1.0)


def strongest(blocks: Blocks, left: F8, basis: F8, band: SearchBand) -> Peak | None:
    """Find the strongest line, and the probability that pure noise produces one as strong.

    None where the band is empty.

    The candidate is the maximum of the spectrum divided by that of a first-order autoregression. The line's evidence is
    half the reduction of chi-square by its cosine and sine beyond the model, over the noise density at its frequency.
    This density is the larger of an autoregression's and the neighbouring frequencies', both without the line. The
    evidence of a noise line would be exponentially distributed if the density were exact. The heavier tail
    :math:`(1 + z/\\nu)^{-\\nu}` accounts for the density's own error [1]_.

    .. [1] D. J. Thomson, "Spectrum estimation and harmonic analysis", Proc. IEEE 70 (1982) 1055,
       doi:10.1109/PROC.1982.12433.
    """
    residual = blocks.unweighted(left)
    frequency, power = spectrum(blocks, residual)
    inside = band.inside(frequency)
    if np.count_nonzero(inside) < 4:
        return None
    coefficients, variance = _autoregression(residual, 1)
    shaped = power[inside] / _density(coefficients, variance, frequency[inside] * blocks.step)
    f = float(frequency[inside][int(np.argmax(shaped))])
    angle = 2.0 * math.pi * f * blocks.t
    pair = np.stack([np.cos(angle), np.sin(angle)]) * blocks.weight
    # First the line itself, then its slow variations, which must not pass for noise beside it.
    powers = np.polynomial.legendre.legvander(2.0 * blocks.t / blocks.seconds - 1.0, VARYING)
    rows = (powers.T[:, None] * pair).reshape(-1, angle.size)
    line = beyond(basis, (rows / np.linalg.norm(rows, axis=1)[:, None]).T)
    if np.linalg.norm(line[:, :2], -2) < 0.2:  # smallest singular value: the model already contains the line
        return None
    noise = blocks.unweighted(left - line @ np.linalg.lstsq(line, left, rcond=None)[0])
    density = spectral_density(blocks, noise, f, band)
    # Rows are weighted by their numbers of samples; the density is that of one full block.
    own = line[:, :2] @ np.linalg.lstsq(line[:, :2], left, rcond=None)[0]
    evidence = 0.5 * float(own @ own) / (density * blocks.samples)
    return Peak(f, density, evidence, false_alarm(evidence, _trials(inside, float(frequency[1]), blocks)))


def false_alarm(evidence: float, trials: float) -> float:
    """Return the probability that at least one of ``trials`` noise lines reaches this evidence.

    >>> false_alarm(0.0, 10.0)
    1.0
    >>> round(false_alarm(30.0, 100.0), 6)
    0.002141
    """
    single = math.exp(-FREEDOM * math.log1p(evidence / FREEDOM))
    return float(-math.expm1(trials * math.log1p(-single))) if single < 1.0 else 1.0


def evidence_for(chance: float, trials: float) -> float:
    """Return the evidence at which :func:`false_alarm` is ``chance``.

    >>> round(false_alarm(evidence_for(0.005, 100.0), 100.0), 6)
    0.005
    """
    single = -math.expm1(math.log1p(-chance) / trials)
    return float(FREEDOM * math.expm1(-math.log(single) / FREEDOM))


def spectral_density(blocks: Blocks, y: F8, frequency_hz: float, band: SearchBand) -> float:
    """Return the noise variance of one block at a frequency, m^2: the larger of the autoregression's and the local."""
    smooth = float(_density(*_autoregression(y, AR_ORDER), np.asarray(frequency_hz * blocks.step)))
    frequency, power = spectrum(blocks, y)
    reach = FARTHEST / blocks.seconds
    around = slice(*np.searchsorted(frequency, [frequency_hz - reach, frequency_hz + reach]))
    near = band.inside(frequency[around]) & (np.abs(frequency[around] - frequency_hz) * blocks.seconds >= NEAREST)
    local = float(np.mean(power[around][near])) if np.count_nonzero(near) >= 4 * OVERSAMPLING else 0.0
    return max(smooth, local, 1e-300)


def _autoregression(y: F8, highest: int) -> tuple[F8, float]:
    """Return coefficients (p,) and innovation variance of the order with the lowest BIC, by the Yule-Walker equations.

    The covariances of an autoregression obey :math:`c_k = \\sum_j a_j c_{|k - j|}`.
    """
    n = y.size
    covariances = np.array([y[lag:] @ y[: n - lag] for lag in range(min(highest, n - 1) + 1)]) / n
    found = []
    for order in range(covariances.size):
        rows, right = np.arange(order), covariances[1 : order + 1]
        coefficients = np.linalg.lstsq(covariances[np.abs(np.subtract.outer(rows, rows))], right, rcond=None)[0]
        variance = max(float(covariances[0] - coefficients @ right), 1e-300)
        found.append((math.log(variance) + order * math.log(n) / n, coefficients, variance))
    _, coefficients, variance = min(found, key=lambda each: each[0])
    return np.asarray(coefficients), variance


def _density(coefficients: F8, variance: float, turns: F8) -> F8:
    """Return the spectral density at frequencies in cycles per block; its mean over all of them is the variance."""
    lags = np.arange(1.0, coefficients.size + 1.0)
    waves = np.exp(-2j * math.pi * np.multiply.outer(turns, lags)) @ coefficients
    return np.asarray(variance / np.abs(1.0 - waves) ** 2)
