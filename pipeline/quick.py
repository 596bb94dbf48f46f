"""Quick: the windows of a regular record by one matrix product, for the fast tier.

All windows of a record with equal steps hold the same times from their centres, so one basis serves all of them and
their fits are one product of matrices. Records that are not regular, or dirtier than single samples, are left to the
standard stages.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.condition import Conditioned
from pipeline.cycles import Cycles
from pipeline.damping import Damping
from pipeline.demodulate import THIRD_TO_SIGMA, WEAK, Demodulated, polar
from pipeline.normal_matrix import inverse_of
from pipeline.phase import PhaseFit
from pipeline.quick_start import bridged
from pipeline.rest import Rest
from pipeline.track import F8, Quality, Track
from pipeline.waveform import Waveform
from pipeline.windows import ranked, solved

C16 = NDArray[np.complex128]

__all__ = ["Quick", "demodulate_quickly"]

OUTLIER_SIGMAS = 4.5  # one good sample in 150,000 lies further off
CLEAN = 0.3  # least share of clean windows; clusters of echoes on a seventh of the samples leave fewer
EXCESS = 1.3  # of the calmest windows' scatter over the noise from differences: beyond, clusters sit in these too


@dataclass(frozen=True, slots=True, eq=False)
class Quick:
    """Windows, and the motion at every sample as their fits have it.

    Parameters
    ----------
    demodulated : Demodulated
    position, velocity : (n,) float64, m, m/s
    length : int
        Samples of a window.
    """

    demodulated: Demodulated
    position: F8
    velocity: F8
    length: int

    def waveform(self, track: Track, damping: Damping, phase: PhaseFit, rest: Rest) -> Waveform:
        """Return the windows' motion with the root mean square that the smooth model leaves."""
        found = self.demodulated
        amplitude = damping.best.amplitude(found.t - damping.t0)
        # Squared distance of two phasors: by their lengths and by the angle between them.
        longer, turned = found.amplitude - amplitude, np.sin(0.5 * (phase.total(found.t) - found.phase))
        swing = 0.5 * float(longer @ longer) + 2.0 * float((found.amplitude * amplitude) @ (turned * turned))
        shift = found.offset - rest.at(found.t)
        inside = float(found.noise @ found.noise) * (1.0 - 3.0 / self.length)
        rms_m = math.sqrt((inside + swing + float(shift @ shift)) / found.t.size)
        return Waveform(self.position, self.velocity, track.y - self.position, rms_m)


def demodulate_quickly(conditioned: Conditioned, cycles: Cycles) -> Quick | None:
    """Fit all windows with one basis; None where the record is not regular or not clean enough for that.

    Parameters
    ----------
    conditioned : Conditioned
    cycles : Cycles

    Notes
    -----
    Windows hold equally many samples, near a whole number of periods. A first product gives phases and amplitudes
    from which frequency and decay are told; a second one in a basis that has them gives the result. How far a window
    differs from the record's mean in either is put right to first order. Windows that hold flagged samples or false
    echoes are fitted again without these, each by itself. Where fewer than three in ten are clean, or where even the
    calmest quarter scatters by more than 1.3 times the noise that differences of neighbours tell, nothing is returned:
    clusters of echoes have then pulled the fits that were to judge them.
    """
    track = conditioned.track
    rows = np.flatnonzero(conditioned.flags == 0) if conditioned.flags.any() else None
    used = len(track) if rows is None else rows.size
    first = 0 if rows is None else int(rows[0])
    last = len(track) - 1 if rows is None else int(rows[-1])
    n = last + 1 - first
    step = (float(track.t[last]) - float(track.t[first])) / max(n - 1, 1)
    windows = len(cycles.bounds) - 1
    if conditioned.plateaus_m or windows < 6 or used < 0.8 * n or not step > 0.0:
        return None
    off = np.arange(n, dtype=np.float64)
    off *= -step
    off += track.t[first : last + 1]
    off = off if rows is None else off[rows - first]
    start = float(track.t[first])
    if not max(float(off.max()) - start, start - float(off.min())) <= 0.02 * step:
        return None
    # Samples left over at the end are lost, and in windows of part periods rest position and swing share samples.
    counts = np.arange(max(windows - max(windows // 8, 1), 5), windows + 1)
    spans = (n // counts) * step * cycles.frequency_hz
    w = int(counts[np.argmin(1.5 * (n % counts) / n + 4.0 * (spans - np.rint(spans)) ** 2)])
    length = n // w
    if length > 4096 or length < 12:
        return None
    return _fit(conditioned, cycles, first, w, length, step)


@dataclass
class _Basis:
    """Rest position, cosine, minus sine, and the latter two times time: the common basis of all windows."""

    omega: float
    decay: float
    rows: F8
    solver: F8
    inverse: F8
    leak: F8

    @cached_property
    def pairs(self) -> F8:
        """(6, l): products of the first three rows, the upper triangle of their normal matrix sample by sample."""
        one, cosine, sine = self.rows[:3]
        return np.stack([one, cosine, sine, cosine * cosine, cosine * sine, sine * sine])

    @classmethod
    def of(cls, tau: F8, omega: float, decay: float) -> _Basis | None:
        """Return the basis; None where times (l,) s do not tell its waves apart."""
        wave = np.exp((1j * omega - decay) * tau)
        rows = np.empty((5, tau.size))
        rows[0], rows[1], rows[2] = 1.0, wave.real, -wave.imag
        np.multiply(rows[1:3], tau, out=rows[3:])
        inverse = inverse_of(rows[:3] @ rows[:3].T)
        if inverse is None:
            return None
        solver = inverse @ rows[:3]
        return cls(omega, decay, rows, solver, inverse, solver @ rows[3:].T)

    def drifting(self, found: F8, slope: C16) -> F8:
        """Coefficients (w, 5) from those of steady waves (w, 3), which change by ``slope`` of themselves a second."""
        change = slope * (found[:, 1] + 1j * found[:, 2])
        whole = np.empty((len(found), 5))
        whole[:, 3], whole[:, 4] = change.real, change.imag
        whole[:, :3] = found - whole[:, 3:] @ self.leak.T
        return whole

    def weighed(self, y: F8, weights: F8) -> _Weighed:
        """Fit steady waves to windows y (w, l) with weights (w, l): one basis, so sums are products of matrices."""
        sums = self.pairs @ weights.T
        coefficients, inverse, good = solved(sums[0], sums[1:], self.rows[:3] @ (weights * y).T)
        return _Weighed(coefficients, inverse, good, np.abs(y - coefficients @ self.rows[:3]))


def _fit(conditioned: Conditioned, cycles: Cycles, first: int, w: int, length: int, step: float) -> Quick | None:
    track = conditioned.track
    part = slice(first, first + w * length)
    bad = conditioned.flags[part].reshape(w, length) != 0
    values = bridged(track.y[part], bad.ravel())
    level = float(values.sum()) / values.size
    y = values.reshape(w, length) - level
    tau: F8 = step * (np.arange(length, dtype=np.float64) - 0.5 * (length - 1))
    t: F8 = float(track.t[first]) + step * (0.5 * (length - 1) + length * np.arange(w, dtype=np.float64))
    rough = _Basis.of(tau, 2.0 * math.pi * cycles.frequency_hz, 0.0)
    if rough is None:
        return None
    basis = _Basis.of(tau, *_neighbours(y @ rough.solver.T, step * length, rough.omega))
    if basis is None:
        return None
    coefficients = y @ basis.solver.T
    residual = coefficients @ basis.rows[:3]
    np.subtract(y, residual, out=residual)
    squares = np.einsum("wl,wl->w", residual, residual)
    # The calmest quarter of the windows tells the noise: clusters of echoes may sit in all others.
    typical = math.sqrt(float(np.partition(squares, w // 4)[w // 4]) / (length - 3)) + 1e-150
    clean, bound = ~bad.any(axis=1), OUTLIER_SIGMAS * typical
    if max(float(residual.max()), -float(residual.min())) > bound:
        clean &= np.abs(residual).max(axis=1) <= bound
    expected = max(conditioned.noise_m, (conditioned.quantum_m or 0.0) / math.sqrt(12.0))
    if typical > EXCESS * expected or np.count_nonzero(clean) < max(CLEAN * w, 5):
        return None
    smooth = _smooth(coefficients, t, basis.omega, clean)
    if float(smooth.amplitude.min()) < WEAK * typical * math.sqrt(2.0 / length):
        return None
    slope = smooth.rate - (1j * basis.omega - basis.decay)
    whole = basis.drifting(coefficients, slope)
    fitted = whole @ basis.rows
    inverse = np.empty((w, 3, 3))
    inverse[:] = basis.inverse
    fits = _Fits(whole, inverse, fitted, y - fitted, np.ones(w, np.bool_))
    if not clean.all():
        fits = _cleaned(fits, clean, basis, y, bad, slope, smooth, typical)
    if np.count_nonzero(fits.good) < max(0.9 * w, 5):
        return None
    return _quick(conditioned, part, t, level, basis, fits, smooth)


class _Weighed(NamedTuple):
    """Weighted fits: coefficients (w, 3), inverses (w, 3, 3), who is good (w,), and residuals' sizes (w, l)."""

    coefficients: F8
    inverse: F8
    good: NDArray[np.bool_]
    size: F8


@dataclass(slots=True)
class _Fits:
    """Coefficients (w, 5), inverse normal matrices (w, 3, 3), curves and residuals (w, l), and who is good (w,).

    ``weights`` (w, l) are None where every sample counts.
    """

    coefficients: F8
    inverse: F8
    fitted: F8
    residual: F8
    good: NDArray[np.bool_]
    weights: F8 | None = None


def _cleaned(
    fits: _Fits,
    clean: NDArray[np.bool_],
    basis: _Basis,
    y: F8,
    bad: NDArray[np.bool_],
    slope: C16,
    smooth: _Smooth,
    level: float,
) -> _Fits:
    """Fit windows that hold flagged samples or false echoes without these.

    They start from what the clean windows' curves foretell; weights of Cauchy's form let go of clusters, and what is
    left beyond four standard deviations is taken out for good.
    """
    hit = np.flatnonzero(~clean)
    z = smooth.amplitude[hit] * np.exp(1j * smooth.phase[hit])
    drift = slope[hit] * z
    others = np.flatnonzero(clean)
    offset = np.interp(hit, others, fits.coefficients[others, 0])
    expected = np.stack([offset, z.real, z.imag, drift.real, drift.imag], axis=1)
    usable = (~bad[hit]).astype(np.float64)
    held = usable * (y[hit] - expected[:, 3:] @ basis.rows[3:])
    size = np.abs(held - expected[:, :3] @ basis.rows[:3])
    for _ in range(3):
        spread = np.maximum(ranked(size, usable, 0.3) / THIRD_TO_SIGMA, level)
        size = basis.weighed(held, usable / (1.0 + (size / spread[:, None]) ** 2) ** 2).size
    for _ in range(2):
        weights = np.where(size <= 4.0 * level, usable, 0.0)
        solution = basis.weighed(held, weights)
        size = solution.size
    found = np.concatenate([solution.coefficients, expected[:, 3:]], axis=1)
    few = weights.sum(axis=1) < 0.4 * y.shape[1]
    curves = found @ basis.rows
    fits = _Fits(
        fits.coefficients.copy(), fits.inverse.copy(), fits.fitted.copy(), fits.residual.copy(), fits.good.copy()
    )
    fits.weights = np.ones(y.shape)
    fits.coefficients[hit], fits.inverse[hit], fits.weights[hit] = found, solution.inverse, weights
    fits.fitted[hit], fits.residual[hit], fits.good[hit] = curves, y[hit] - curves, solution.good & ~few
    return fits


def _neighbours(coefficients: F8, apart_s: float, omega: float) -> tuple[float, float]:
    """Angular frequency, rad/s, and decay, 1/s, from what windows differ from their neighbours."""
    z = coefficients[:, 1] + 1j * coefficients[:, 2]
    turn = complex(np.vdot(z[:-1], z[1:])) * np.exp(-1j * omega * apart_s)
    size = np.abs(z)
    ratio = float(size[:-1] @ size[1:]) / max(float(size[:-1] @ size[:-1]), 1e-300)
    return omega + math.atan2(turn.imag, turn.real) / apart_s, -math.log(max(ratio, 1e-300)) / apart_s


@dataclass(slots=True)
class _Smooth:
    """Cubics through the windows' complex amplitudes: total phase, amplitude, and logarithmic rate at each centre."""

    phase: F8
    amplitude: F8
    rate: C16


def _smooth(coefficients: F8, t: F8, omega: float, clean: NDArray[np.bool_]) -> _Smooth:
    _, a, b = coefficients.T
    size = np.hypot(a, b) + 1e-150
    since = t - t[0]
    angle = np.arctan2(b, a) - omega * since
    angle[clean] = _unwrapped(angle[clean])
    half = 0.5 * float(since[-1])
    x = since / half - 1.0
    order = min(3, max(1, t.size // 6)) + 1
    powers = np.ones((order, t.size))
    for k in range(1, order):
        np.multiply(powers[k - 1], x, out=powers[k])
    weighted = powers * np.where(clean, size, 0.0) ** 2
    curve = np.linalg.solve(weighted @ powers.T, weighted @ np.array([np.log(size), angle]).T)
    level, turned = curve.T @ powers
    rates = (curve[1:] * (np.arange(1, order) / half)[:, None]).T @ powers[:-1]
    return _Smooth(turned + omega * since, np.exp(level), rates[0] + 1j * (rates[1] + omega))


def _unwrapped(angle: F8) -> F8:
    """Angles without jumps of more than half a turn between neighbours."""
    turns = np.rint((angle[1:] - angle[:-1]) / (2.0 * math.pi))
    angle[1:] -= 2.0 * math.pi * turns.cumsum()
    return angle


def _quick(
    conditioned: Conditioned, part: slice, t: F8, level: float, basis: _Basis, fits: _Fits, smooth: _Smooth
) -> Quick:
    track, length = conditioned.track, basis.rows.shape[1]
    counts = np.full(len(t), length) if fits.weights is None else np.sum(fits.weights, axis=1).astype(np.int64)
    weighted = fits.residual if fits.weights is None else fits.weights * fits.residual
    squares = np.einsum("wl,wl->w", fits.residual, weighted)
    free = counts - 3
    spread = squares / np.maximum(free, 1)
    noise = np.sqrt(spread)
    keep = slice(None) if fits.good.all() else fits.good
    pooled = float(squares[keep].sum()) / float(free[keep].sum())
    variance = (30.0 * pooled + counts * spread) / (30.0 + counts)
    coefficients = fits.coefficients
    amplitude, phase, covariance = polar(
        coefficients[keep, 1],
        coefficients[keep, 2],
        fits.inverse[keep] * variance[keep, None, None],
        smooth.phase[keep],
        smooth.amplitude[keep],
    )
    position, velocity = _motion(track, part, t, level, basis, fits)
    left = track.y - position
    left[: part.start] = left[part.stop :] = np.nan
    flags = conditioned.flags.copy()
    if fits.weights is not None:
        within = flags[part].reshape(fits.weights.shape)
        within[(fits.weights == 0.0) & (within == 0)] |= np.uint8(Quality.FALSE_ECHO)
    demodulated = Demodulated(
        t[keep],
        amplitude,
        phase,
        coefficients[keep, 0] + level,
        noise[keep],
        covariance,
        counts[keep],
        basis.omega,
        -smooth.rate.real[keep],
        left,
        flags,
        int(np.count_nonzero(~fits.good)),
    )
    return Quick(demodulated, position, velocity, length)


def _motion(track: Track, part: slice, t: F8, level: float, basis: _Basis, fits: _Fits) -> tuple[F8, F8]:
    """Position and velocity at every sample as the windows have them; the first and the last reach to the ends."""
    coefficients, shape = fits.coefficients, fits.fitted.shape
    rate = 1j * basis.omega - basis.decay
    z = coefficients[:, 1] + 1j * coefficients[:, 2]
    change = z * rate
    position, velocity = np.empty(len(track)), np.empty(len(track))
    np.add(fits.fitted, level, out=position[part].reshape(shape))
    np.matmul(np.stack([change.real, change.imag], axis=1), basis.rows[1:3], out=velocity[part].reshape(shape))
    for outside, window in ((slice(0, part.start), 0), (slice(part.stop, len(track)), -1)):
        if outside.start < outside.stop:
            wave = z[window] * np.exp(rate * (track.t[outside] - t[window]))
            position[outside] = level + coefficients[window, 0] + wave.real
            velocity[outside] = (wave * rate).real
    return position, velocity
