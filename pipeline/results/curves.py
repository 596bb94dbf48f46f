"""Curves with uncertainty bands: energy against time, drag coefficient against amplitude, and the motion of the bob.

The motion is that of the fit: with :math:`x = x_0 + \\mathrm{Re}\\,z`, :math:`z = A e^{i\\varphi}` and the decay rate
:math:`\\lambda = -\\dot A/A`, the velocity is :math:`\\mathrm{Re}\\,(i\\omega - \\lambda) z` and the acceleration
:math:`\\mathrm{Re}\\,(i\\omega - \\lambda)^2 z`. Nothing is differenced, so noise is not amplified.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.checks.residual import PARTS
from pipeline.damping.average import Weighted
from pipeline.damping.law_fit import LawFit
from pipeline.damping.laws.drag import COEFFICIENTS
from pipeline.damping.select import Damping
from pipeline.dynamics.equation import Equation
from pipeline.motion.fitted import Oscillation, Phase
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.levels import FEWEST_FOR_LINE, MISFIT
from pipeline.numerics.regression import solve_weighted
from pipeline.track import F8, Quality, Track
from pipeline.windows.demodulate import Windows

# Number of points of a drawn curve: by the formula h^2/8, lines between them miss a decay to e^-7 by 2e-4 of its value.
CURVE_POINTS = 200


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A quantity by the selected law, with its uncertainty band, and points calculated without a law."""

    # x, y, u: (n,), the curve and its standard uncertainty, including all known contributions.
    x: F8
    y: F8
    u: F8
    unit: str  # unit of y
    # x_points, y_points, u_points: (m,), points from the amplitudes of windows. ``u_points`` includes only their
    # scatter, and no errors that all points share.
    x_points: F8
    y_points: F8
    u_points: F8


def energy_curve(damping: Damping, windows: Windows, factor: Estimate, laws: Sequence[Weighted], unit: str) -> Curve:
    """Return the mechanical energy :math:`E = \\frac12 m\\omega^2 A^2` against time.

    The uncertainty is :math:`u^2(E) = \\sum_i w_i[(2 E_i\\,u(A_i)/A_i)^2 + (E_i - E)^2] + (E\\,u_F/F)^2`, summed over
    ``laws``; E is the energy by the selected law.
    """
    t = windows.t
    x = np.linspace(damping.t0, float(t[-1]), CURVE_POINTS)
    best = damping.best
    amplitude = best.amplitude(x - damping.t0)
    energy = factor.value * amplitude**2
    variance = (energy * factor.u / factor.value) ** 2
    for one in laws:
        other = one.fit.amplitude(x - damping.t0)
        own = 2.0 * factor.value * other * one.fit.u_amplitude(x - damping.t0)
        variance += one.weight * (own**2 + (factor.value * other**2 - energy) ** 2)
    points = factor.value * windows.amplitude**2
    return Curve(
        x=x,
        y=energy,
        u=np.sqrt(variance),
        unit=unit,
        x_points=t,
        y_points=points,
        u_points=2.0 * factor.value * np.abs(windows.amplitude) * damping.scatter.u,
    )


def drag_curve(damping: Damping, windows: Windows, factor: Estimate, laws: Sequence[Weighted]) -> Curve | None:
    """Return the drag coefficient against amplitude; None if the amplitude does not decrease.

    The curve is the coefficient with which purely quadratic drag would dissipate the same energy in one cycle:
    :math:`C(A) = F\\,(-\\dot A - \\mu)/A^2`. Friction is no drag, so the friction of the selected law, if it has any,
    is subtracted. All other losses are included, also those in the spring. The points come from slopes of ln A over
    groups of windows.
    """
    best = damping.best
    elapsed = windows.t - damping.t0
    fitted = best.amplitude(elapsed)
    least, most = float(np.min(fitted)), float(np.max(fitted))
    if not (0.0 < least < most):
        return None
    # Amplitudes beyond the record would be extrapolated; a logarithmic spacing shows small amplitudes too.
    x = np.geomspace(least, most, CURVE_POINTS)

    def coefficient(fit: LawFit, theta: F8) -> F8:
        friction = _friction(best, theta if fit.name == best.name else best.joint.values)
        return factor.value * (-fit.law.rate(x, theta) - friction) / x**2

    y = coefficient(best, best.joint.values)
    variance = (y * factor.u / factor.value) ** 2
    for fit, weight in ((one.fit, one.weight) for one in laws):
        gradient = fit.by_parameters(functools.partial(coefficient, fit))
        variance += weight * (fit.u_of(gradient) ** 2 + (coefficient(fit, fit.joint.values) - y) ** 2)
    return Curve(x, y, np.sqrt(variance), "", *_local_drag(damping, windows, factor.value))


def _friction(fit: LawFit, theta: F8) -> float:
    return 0.0 if fit.drag_term("mu") is None else float(theta[fit.joint.names.index("mu")])


def _local_drag(damping: Damping, windows: Windows, factor: float) -> tuple[F8, F8, F8]:
    """Return amplitude, drag coefficient and its scatter for groups of windows, without assuming a law of drag."""
    kept = damping.scatter.kept
    t, amplitude, u = windows.t[kept], windows.amplitude[kept], damping.scatter.u[kept]
    groups = min(PARTS, t.size // FEWEST_FOR_LINE)
    rows = []
    for part in np.array_split(np.arange(t.size), groups) if groups else []:
        a, middle = amplitude[part], float(np.mean(t[part]))
        if np.any(a <= 0):
            continue
        line = solve_weighted(np.stack([np.ones(part.size), t[part] - middle], axis=1), np.log(a), u[part] / a)
        centre = math.exp(float(line.values[0]))
        slope = -float(line.values[1]) - _friction(damping.best, damping.best.joint.values) / centre
        spread = math.sqrt(float(line.covariance[1, 1]) * damping.scatter.correlation)
        rows.append((centre, factor * slope / centre, factor * spread / centre))
    x, y, scatter = np.array(rows).reshape(-1, 3).T
    return x, y, scatter


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


def kinematics(track: Track, fitted: Oscillation, laws: Sequence[Weighted]) -> Smoothed:
    """Return the motion at every sample; NaN at samples without a time and outside the part that was analysed.

    Where the fit does not describe the record, amplitude and phase are those of the windows. The uncertainties exclude
    those of clock and scale, which are common factors.
    """
    phase, windows = fitted.phase, fitted.windows
    known = np.isfinite(track.t) & ((windows.flags & Quality.OUTSIDE) == 0)
    used = known & windows.used
    t = np.where(known, track.t, phase.t0)
    elapsed = np.clip(t, phase.t0, float(np.max(track.t[used]))) - phase.t0
    best = fitted.damping.best
    size, u_size = _averaged(laws, elapsed)
    angle, u_angle = phase.total(t), _u_phase(phase, t)
    solved = fitted.method == "equation"
    if not solved and (best.rejected or fitted.waveform.rms > MISFIT * windows.noise):
        at = windows.t
        expected, _ = _averaged(laws, at - phase.t0)
        size = size + np.interp(t, at, windows.amplitude - expected)
        angle = angle + np.interp(t, at, windows.phase - phase.total(at))
        u_size = np.interp(t, at, np.sqrt(windows.covariance[:, 0, 0]))
        u_angle = np.interp(t, at, np.sqrt(windows.covariance[:, 1, 1]))
    swing = size * np.exp(1j * angle)
    decay = -best.law.rate(np.abs(size), best.joint.values) / np.maximum(np.abs(size), 1e-300)
    turn = 1j * phase.rate(size, t) - np.where(np.isfinite(decay), decay, 0.0)
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


def _by_equation(fitted: Oscillation, x: F8, v: F8) -> F8:
    """Return the acceleration by the fitted equation of motion; 0 where friction holds the bob."""
    found, phase = fitted.damping.best.joint.estimates(), fitted.phase
    mu, gamma, beta = (found[name].value if name in found else 0.0 for name in COEFFICIENTS)
    natural = math.sqrt(phase.angular_frequency.value**2 + (phase.squared_rate or 0.0))
    equation = Equation.from_laws(natural, gamma_per_s=gamma, beta_per_m_s=beta, mu_m_per_s=mu)
    return np.where(v == 0.0, 0.0, equation.acceleration(x, v))
