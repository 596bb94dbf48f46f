"""Quick: the windows of a regular record by one matrix product, for the fast tier.

All windows of a record with equal steps hold the same times from their centres, so one basis serves all of them and
their fits are one product of matrices. Records that are not regular, or dirtier than single samples, are left to the
standard stages.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.condition import (
    FOURTH_DIFFERENCE_GAIN,
    MAD_TO_SIGMA,
    Conditioned,
    coarsest_step,
    condition,
)
from pipeline.condition import Params as ConditionParams
from pipeline.cycles import Cycles, NoOscillation, find_cycles
from pipeline.cycles import Params as CyclesParams
from pipeline.damping import Damping
from pipeline.demodulate import Demodulated, polar
from pipeline.phase import PhaseFit
from pipeline.rest import Rest
from pipeline.track import F8, Quality, Track
from pipeline.waveform import Waveform

__all__ = ["Quick", "condition_quickly", "demodulate_quickly", "find_cycles_quickly"]

OUTLIER_SIGMAS = 4.5  # one good sample in 150,000 lies further off
SMOOTH = 8.0  # greatest over median second difference: 1.4 for curvature, 6.3 for the noise of 12,000 samples


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
        expected = amplitude * np.exp(1j * (phase.total(found.t) - found.phase))
        swing = 0.5 * float(np.mean(np.abs(found.amplitude - expected) ** 2))
        shift = float(np.mean((found.offset - rest.at(found.t)) ** 2))
        inside = float(np.mean(found.noise**2)) * (1.0 - 3.0 / self.length)
        return Waveform(self.position, self.velocity, track.y - self.position, math.sqrt(inside + swing + shift))


def condition_quickly(track: Track, params: ConditionParams) -> Conditioned:
    """Pass a clean track in a few sweeps; hand any other to :func:`pipeline.condition.condition`.

    Parameters
    ----------
    track : Track
    params : pipeline.condition.Params

    Notes
    -----
    Clean means: no flag, all finite, time strictly increasing, no second difference beyond eight times their median
    (a spike of seven standard deviations makes one), and at neither end of the range a band with three times as many
    samples as the next one.
    """
    y = track.y
    if len(track) < 64 or track.flags.any() or not (np.isfinite(y).all() and np.isfinite(track.t).all()):
        return condition(track, params)
    second = y[2:] - 2.0 * y[1:-1] + y[:-2]
    typical = float(np.median(np.abs(second[:: max(second.size // 2000, 1)])))
    extreme = max(float(second.max()), -float(second.min()))
    if not (np.diff(track.t).min() > 0.0 and 0.0 < extreme <= SMOOTH * typical):
        return condition(track, params)
    fourth = second[2:] - 2.0 * second[1:-1] + second[:-2]
    noise_m = MAD_TO_SIGMA * float(np.median(np.abs(fourth[:: max(fourth.size // 4000, 1)]))) / FOURTH_DIFFERENCE_GAIN
    width = 8.0 * max(noise_m, 0.5 * (track.quantum_m or 0.0))
    low, high = float(y.min()), float(y.max())
    for top in (y - low, high - y):
        inside = np.count_nonzero(top <= width)
        if inside > max(0.02 * y.size, 8) and inside > 3.0 * (np.count_nonzero(top <= 2.0 * width) - inside):
            return condition(track, params)
    ordered = np.sort(y[:1000])
    return Conditioned(track, track.flags.copy(), noise_m, (), coarsest_step(ordered, track.quantum_m))


def find_cycles_quickly(conditioned: Conditioned, params: CyclesParams) -> Cycles | NoOscillation:
    """Find the frequency on means of neighbouring samples, where a period has plenty of them."""
    track = conditioned.track
    block = len(track) // 3000
    if block >= 2 and not conditioned.flags.any():
        whole = len(track) // block * block
        few = replace(
            track,
            t=track.t[:whole].reshape(-1, block).mean(axis=1),
            y=track.y[:whole].reshape(-1, block).mean(axis=1),
            flags=np.zeros(whole // block, np.uint8),
            rate_hz=track.rate_hz / block,
        )
        noise_m = conditioned.noise_m / math.sqrt(block)
        found = find_cycles(replace(conditioned, track=few, flags=few.flags, noise_m=noise_m), params)
        if isinstance(found, Cycles) and found.frequency_hz < few.rate_hz / 10.0:
            return replace(found, bounds=found.bounds * block)
    return find_cycles(conditioned, params)


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
    differs from the record's mean in either is put right to first order. Flagged samples are replaced by the fit
    itself until that stands still, which is the fit without them.
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
    regular = track.t[first] + step * np.arange(n)
    off = np.abs(track.t[first : last + 1] - regular)
    if not float(np.max(off if rows is None else off[rows - first])) <= 0.02 * step:
        return None
    counts = np.arange(max(windows - max(windows // 8, 1), 5), windows + 1)
    w = int(counts[np.lexsort((-counts, n % counts))[0]])
    length = n // w
    if length > 4096 or length < 12:
        return None
    return _fit(conditioned, cycles, first, w, length, step)


@dataclass(slots=True)
class _Basis:
    """Rest position, cosine, minus sine, and the latter two times time: the common basis of all windows."""

    rows: F8
    solver: F8
    inverse: F8
    leak: F8

    @classmethod
    def of(cls, tau: F8, omega: float, decay: float) -> _Basis:
        wave = np.exp((1j * omega - decay) * tau)
        rows = np.stack([np.ones(tau.size), wave.real, -wave.imag, tau * wave.real, -tau * wave.imag])
        inverse = np.linalg.inv(rows[:3] @ rows[:3].T)
        solver = inverse @ rows[:3]
        return cls(rows, solver, inverse, solver @ rows[3:].T)

    def fit(self, y: F8, slope: F8) -> F8:
        """Coefficients (w, 5) of windows y (w, l) whose complex amplitude changes by ``slope`` of itself per second."""
        found = y @ self.solver.T
        change = slope * (found[:, 1] + 1j * found[:, 2])
        drift = np.stack([change.real, change.imag], axis=1)
        return np.concatenate([found - drift @ self.leak.T, drift], axis=1)


def _fit(conditioned: Conditioned, cycles: Cycles, first: int, w: int, length: int, step: float) -> Quick | None:
    track = conditioned.track
    part = slice(first, first + w * length)
    bad = conditioned.flags[part].reshape(w, length) != 0
    dirty = np.flatnonzero(bad.any(axis=1))
    values = track.y[part]
    if dirty.size:
        good = np.flatnonzero(~bad.ravel())
        values = np.interp(np.arange(w * length), good, values[good])
    level = float(values.mean())
    y = values.reshape(w, length) - level
    tau = step * (np.arange(length) - 0.5 * (length - 1))
    t = float(track.t[first]) + step * (0.5 * (length - 1) + length * np.arange(w))
    omega = 2.0 * math.pi * cycles.frequency_hz
    basis = _Basis.of(tau, omega, 0.0)
    smooth = _smooth(y @ basis.solver.T, t, omega, 1)
    omega, decay = smooth.mean_rate()
    basis = _Basis.of(tau, omega, decay)
    smooth = _smooth(y @ basis.solver.T, t, omega, 3)
    slope = smooth.rate - (1j * omega - decay)
    for attempt in range(2):
        coefficients = basis.fit(y, slope)
        if dirty.size:
            coefficients = _without(bad, dirty, y, basis, slope, coefficients)
        residual = y - coefficients @ basis.rows
        squares = np.einsum("wl,wl->w", residual, residual)
        typical = float(np.median(squares)) / max(length - 3, 1)
        odd = np.abs(residual) > OUTLIER_SIGMAS * math.sqrt(typical)
        odd &= ~bad
        if not odd.any():
            break
        hit = np.flatnonzero(odd.any(axis=1))
        # Single samples are taken out; what comes in numbers comes in clusters, which pull a window's fit.
        if attempt or hit.size > max(2, 0.1 * w) or odd.sum(axis=1).max() > 3:
            return None
        bad |= odd
        dirty = np.flatnonzero(bad.any(axis=1))
    counts = length - bad.sum(axis=1)
    keep = counts > 0.7 * length
    if np.count_nonzero(keep) < max(0.9 * w, 5):
        return None
    return _quick(conditioned, part, t, level, tau, basis, coefficients, residual, bad, keep, smooth, omega, decay)


def _without(bad: NDArray[np.bool_], dirty: NDArray[np.int64], y: F8, basis: _Basis, slope: F8, found: F8) -> F8:
    """Fit the windows that hold bad samples without these: replaced by the fit until it stands still."""
    for _ in range(6):
        y[dirty] = np.where(bad[dirty], found[dirty] @ basis.rows, y[dirty])
        found[dirty] = basis.fit(y[dirty], slope[dirty])
    return found


@dataclass(slots=True)
class _Smooth:
    """Curves through the windows' complex amplitudes: total phase, amplitude, and logarithmic rate at each centre."""

    phase: F8
    amplitude: F8
    rate: NDArray[np.complex128]
    weight: F8

    def mean_rate(self) -> tuple[float, float]:
        """Angular frequency, rad/s, and decay, 1/s, typical of the record."""
        mean = complex(np.average(self.rate, weights=self.weight))
        return mean.imag, -mean.real


def _smooth(coefficients: F8, t: F8, omega: float, degree: int) -> _Smooth:
    z = coefficients[:, 1] + 1j * coefficients[:, 2]
    weight = np.abs(z) ** 2 + 1e-300
    since = t - t[0]
    angle = np.unwrap(np.angle(z) - omega * since)
    span = float(since[-1])
    x = 2.0 * since / span - 1.0
    degree = min(degree, max(1, t.size // 6))
    design = np.polynomial.legendre.legvander(x, degree)
    weighted = design * weight[:, None]
    curve = np.linalg.solve(weighted.T @ design, weighted.T @ np.stack([0.5 * np.log(weight), angle], axis=1))
    fitted = design @ curve
    slopes = np.polynomial.legendre.legval(x, np.polynomial.legendre.legder(curve)) * (2.0 / span)
    return _Smooth(fitted[:, 1] + omega * since, np.exp(fitted[:, 0]), slopes[0] + 1j * (slopes[1] + omega), weight)


def _quick(
    conditioned: Conditioned,
    part: slice,
    t: F8,
    level: float,
    tau: F8,
    basis: _Basis,
    coefficients: F8,
    residual: F8,
    bad: NDArray[np.bool_],
    keep: NDArray[np.bool_],
    smooth: _Smooth,
    omega: float,
    decay: float,
) -> Quick:
    track, length = conditioned.track, tau.size
    counts = length - bad.sum(axis=1)
    squares = np.einsum("wl,wl->w", residual, np.where(bad, 0.0, residual))
    noise = np.sqrt(squares / (counts - 3))
    pooled = float(np.sum(squares[keep])) / float(np.sum(counts[keep] - 3))
    variance = (30.0 * pooled + counts * noise**2) / (30.0 + counts) * (length / counts)
    inverse = basis.inverse * variance[keep, None, None]
    amplitude, phase, covariance = polar(
        coefficients[keep, 1], coefficients[keep, 2], inverse, smooth.phase[keep], smooth.amplitude[keep]
    )
    flags = conditioned.flags.copy()
    within = flags[part].reshape(bad.shape)
    within[bad & (within == 0)] |= np.uint8(Quality.FALSE_ECHO)
    left = np.full(len(track), np.nan)
    left[part] = np.where(np.isfinite(track.y[part]), residual.ravel(), np.nan)
    known = bad & np.isfinite(track.y[part]).reshape(bad.shape)
    position = np.empty(len(track))
    position[part] = (level + coefficients @ basis.rows).ravel()
    left[part][known.ravel()] = (track.y[part] - position[part])[known.ravel()]
    z = (coefficients[:, 1] + 1j * coefficients[:, 2]) * (1j * omega - decay)
    velocity = np.empty(len(track))
    velocity[part] = (z.real[:, None] * basis.rows[1] + z.imag[:, None] * basis.rows[2]).ravel()
    for outside, window in ((slice(0, part.start), 0), (slice(part.stop, len(track)), -1)):
        since = track.t[outside] - t[window]
        wave = np.exp((1j * omega - decay) * since) * (coefficients[window, 1] + 1j * coefficients[window, 2])
        position[outside] = level + coefficients[window, 0] + wave.real
        velocity[outside] = (wave * (1j * omega - decay)).real
    demodulated = Demodulated(
        t[keep],
        amplitude,
        phase,
        coefficients[keep, 0] + level,
        noise[keep],
        covariance,
        counts[keep],
        omega,
        -smooth.rate.real[keep],
        left,
        flags,
        int(np.count_nonzero(~keep)),
    )
    return Quick(demodulated, position, velocity, length)
