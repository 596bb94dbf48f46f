"""Waveform: the rest position against time, and the record predicted from rest position, damping law and phase."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from pipeline.motion.phase import PhaseFit
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.regression import correlation_length, scatter, smooth_curve
from pipeline.track import F8, UNUSABLE, Track
from pipeline.windows.demodulate import Demodulated
from pipeline.windows.disturbances import Disturbances


@dataclass(frozen=True, slots=True, eq=False)
class Rest:
    """The rest position.

    Parameters
    ----------
    mean : Estimate
        Mean over the record, m.
    drift_m : float
        Peak-to-peak range of the smooth curve through the windows' rest positions, m.
    drifts : bool
        Whether the curve fits much better than a constant.
    t, curve : (w,) float64, s, m
        Times of the windows' centres, and the curve at these times.
    """

    mean: Estimate
    drift_m: float
    drifts: bool
    t: F8
    curve: F8

    def at(self, t: F8) -> F8:
        """Return the rest position in m at times t (n,) in s."""
        return np.interp(t, self.t, self.curve) if self.drifts else np.full(t.size, self.mean.value)


def fit_rest(demodulated: Demodulated, *, degree: int = 6, evidence: float = 10.0) -> Rest:
    """Fit a constant and a polynomial to the windows' rest positions, and decide by BIC whether they drift.

    Parameters
    ----------
    demodulated : Demodulated
    degree : int
        Maximum degree of the polynomial; it is lower if there are few windows.
    evidence : float
        Minimum decrease of the BIC for the polynomial to count as a drift.
    """
    t, offset = demodulated.t, demodulated.offset
    u = np.maximum(np.sqrt(demodulated.covariance[:, 2, 2]), 1e-15 * float(np.max(np.abs(offset))) + 1e-100)
    spread = scatter(t, offset, u, degree=degree)
    polynomial, gain = smooth_curve(t, offset, spread, degree=degree)
    weight = 1.0 / spread.u[spread.kept]
    mean = float(np.average(offset[spread.kept], weights=weight**2))
    left = (offset[spread.kept] - mean) * weight
    widened = max(spread.correlation, correlation_length(left)) * max(1.0, float(left @ left) / max(left.size - 1, 1))
    estimate = Estimate(mean, math.sqrt(widened / float(weight @ weight)), "m")
    curve = np.asarray(polynomial(t), np.float64)
    return Rest(estimate, float(np.ptp(curve)), gain > evidence, t, curve)


@dataclass(frozen=True, eq=False)
class Waveform:
    """The fitted motion at every sample.

    Parameters
    ----------
    position : (n,) float64, m
        Rest position + A(t) cos(phase(t)).
    moving : callable
        Computes :attr:`velocity` on first use, as only figures need it.
    residual : (n,) float64, m
        Distance minus position; NaN where no distance was measured.
    rms_m : float
        Root mean square of the residual over the samples used, m.
    """

    position: F8
    moving: Callable[[], F8]
    residual: F8
    rms_m: float

    @cached_property
    def velocity(self) -> F8:
        """Derivative of the oscillation, (n,) float64, m/s."""
        return self.moving()

    def with_disturbances(self, disturbances: Disturbances) -> Waveform:
        """Return the waveform with disturbances added that had been subtracted from the record before the fit."""
        return replace(self, position=self.position + disturbances.position) if disturbances else self


def reconstruct(track: Track, demodulated: Demodulated, phase: PhaseFit, rest: Rest) -> Waveform:
    """Compute the waveform from rest position, amplitude and phase.

    Parameters
    ----------
    track : Track
    demodulated : Demodulated
        Provides the flags.
    phase : PhaseFit
        Provides the phase and the damping law.
    rest : Rest

    Returns
    -------
    Waveform
        Its residual contains the noise and everything that the model does not describe; compare ``rms_m`` with the
        noise.
    """
    law = phase.damping.best
    used = (demodulated.flags & UNUSABLE) == 0
    # A law is valid only where it was fitted: before the first and after the last sample used it is held constant.
    last = float(np.max(track.t, where=used, initial=-np.inf))
    elapsed = np.clip(track.t, phase.t0, last) - phase.t0
    amplitude = law.amplitude(elapsed)
    angle = phase.total(track.t)
    position = rest.at(track.t) + amplitude * np.cos(angle)
    residual = track.y - position
    moving = partial(_velocity, phase, amplitude, angle)
    left = residual if used.all() else residual[used]
    return Waveform(position, moving, residual, math.sqrt(float(left @ left) / left.size))


def _velocity(phase: PhaseFit, amplitude: F8, angle: F8) -> F8:
    law = phase.damping.best
    growth = law.law.rate(amplitude, law.joint.values)
    return np.asarray(growth * np.cos(angle) - amplitude * phase.rate(amplitude) * np.sin(angle))
