"""Kinematics: position, velocity and acceleration at every sample, with uncertainties, from the fit and its covariance.

With :math:`x = x_0 + \\mathrm{Re}\\,z`, :math:`z = A e^{i\\varphi}` and the decay rate :math:`\\lambda = -\\dot A/A`,
the velocity is :math:`\\mathrm{Re}\\,(i\\omega - \\lambda) z` and the acceleration
:math:`\\mathrm{Re}\\,(i\\omega - \\lambda)^2 z`. Nothing is differenced, so noise is not amplified.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.damping.average import Weighted
from pipeline.damping.laws.drag import COEFFICIENTS
from pipeline.motion.averaged import Fitted, Phase
from pipeline.numerics.levels import MISFIT
from pipeline.track import F8, UNUSABLE, Quality, Track


@dataclass(frozen=True, slots=True, eq=False)
class Smoothed:
    """The bob's motion along the line of sight."""

    t: F8  # (n,) s, the track's times
    # position, u_position: (n,) m, distance from the sensor without sideways modes.
    position: F8
    u_position: F8
    # velocity, u_velocity: (n,) m/s, velocity of the oscillation about the rest position.
    velocity: F8
    u_velocity: F8
    # acceleration, u_acceleration: (n,) m/s^2.
    acceleration: F8
    u_acceleration: F8


def kinematics(track: Track, fitted: Fitted, laws: Sequence[Weighted]) -> Smoothed:
    """Return the motion at every sample; NaN at samples without a time and outside the part that was analysed.

    Where the fit does not describe the record, amplitude and phase are those of the windows. The uncertainties exclude
    those of clock and scale, which are common factors.
    """
    phase, windows = fitted.phase, fitted.demodulated
    known = np.isfinite(track.t) & ((windows.flags & Quality.OUTSIDE) == 0)
    used = known & ((windows.flags & UNUSABLE) == 0)
    t = np.where(known, track.t, phase.t0)
    elapsed = np.clip(t, phase.t0, float(np.max(track.t[used]))) - phase.t0
    best = fitted.damping.best
    size, u_size = _averaged(laws, elapsed)
    angle, u_angle = phase.total(t), _u_phase(phase, t)
    solved = fitted.method == "equation"
    if not solved and (best.rejected or fitted.waveform.rms_m > MISFIT * windows.noise_m):
        at = windows.t
        expected, _ = _averaged(laws, at - phase.t0)
        size = size + np.interp(t, at, windows.amplitude - expected)
        angle = angle + np.interp(t, at, windows.phase - phase.total(at))
        u_size = np.interp(t, at, np.sqrt(windows.covariance[:, 0, 0]))
        u_angle = np.interp(t, at, np.sqrt(windows.covariance[:, 1, 1]))
    swing = size * np.exp(1j * angle)
    decay = -best.law.rate(np.abs(size), best.joint.values) / np.maximum(np.abs(size), 1e-300)
    turn = 1j * phase.rate(size) - np.where(np.isfinite(decay), decay, 0.0)
    x, v, a = np.real(swing), np.real(turn * swing), np.real(turn**2 * swing)
    if solved:
        x, v = fitted.waveform.position - fitted.rest.at(t), fitted.waveform.velocity
        a = _by_equation(fitted, x, v)
    # Errors of amplitude and phase turn with the motion, and that of the frequency grows with the order.
    across = np.abs(size) * u_angle
    u = [
        np.hypot(np.real(factor * np.exp(1j * angle)) * u_size, np.imag(factor * np.exp(1j * angle)) * across)
        for factor in (np.ones(t.size), turn, turn**2)
    ]
    of_rate = phase.angular_frequency.u * np.abs(size)
    u[0] = np.hypot(u[0], fitted.rest.mean.u)
    u[1] = np.hypot(u[1], np.sin(angle) * of_rate)
    u[2] = np.hypot(u[2], 2.0 * phase.angular_frequency.value * np.cos(angle) * of_rate)
    motion = (x + fitted.rest.at(t), u[0], v, u[1], a, u[2])
    return Smoothed(track.t, *(np.where(known, each, np.nan) for each in motion))


def _averaged(laws: Sequence[Weighted], elapsed: F8) -> tuple[F8, F8]:
    """Return the amplitude, m, averaged over the laws, and its uncertainty, which includes their differences."""
    weights = np.array([one.weight for one in laws])
    each = np.array([one.fit.amplitude(elapsed) for one in laws])
    own = np.array([one.fit.u_amplitude(elapsed) for one in laws])
    mean = weights @ each
    return mean, np.sqrt(weights @ (own**2 + (each - mean) ** 2))


def _u_phase(phase: Phase, t: F8) -> F8:
    """Return the uncertainty of the phase, rad: that of the line's middle, and that of its slope times the distance."""
    slope, at_start, way = phase.angular_frequency.u, phase.phase.u, phase.t0 - phase.middle
    middle = math.sqrt(max(at_start**2 - (slope * way) ** 2, 0.0))
    return np.hypot(middle, slope * (t - phase.middle))


def _by_equation(fitted: Fitted, x: F8, v: F8) -> F8:
    """Return the acceleration by the fitted equation of motion; 0 where friction holds the bob."""
    found, phase = fitted.damping.best.joint.estimates(), fitted.phase
    mu, gamma, beta = (found[name].value if name in found else 0.0 for name in COEFFICIENTS)
    natural = math.sqrt(phase.angular_frequency.value**2 + (phase.squared_rate or 0.0))
    drag = (2.0 * gamma + 0.75 * math.pi * beta / natural * np.abs(v)) * v + 0.5 * math.pi * natural * mu * np.sign(v)
    return np.where(v == 0.0, 0.0, -(natural**2) * x - drag)
