"""Curves with uncertainty bands: energy against time, and drag coefficient against amplitude."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.damping.average import Weighted
from pipeline.damping.law_fit import LawFit
from pipeline.damping.select import Damping
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.levels import FEWEST_FOR_LINE
from pipeline.numerics.regression import solve_weighted
from pipeline.track import F8
from pipeline.windows.demodulate import Demodulated

POINTS = 200  # number of points of a drawn curve
GROUPS = 12  # maximum number of groups of windows whose local slopes are drawn with the curve


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


def energy_curve(
    damping: Damping, demodulated: Demodulated, factor: Estimate, laws: Sequence[Weighted], unit: str
) -> Curve:
    """Return the mechanical energy :math:`E = \\frac12 m\\omega^2 A^2` against time.

    The uncertainty is :math:`u^2(E) = \\sum_i w_i[(2 E_i\\,u(A_i)/A_i)^2 + (E_i - E)^2] + (E\\,u_F/F)^2`, summed over
    ``laws``; E is the energy by the selected law.
    """
    t = demodulated.t
    x = np.linspace(damping.t0, float(t[-1]), POINTS)
    best = damping.best
    amplitude = best.amplitude(x - damping.t0)
    energy = factor.value * amplitude**2
    variance = (energy * factor.u / factor.value) ** 2
    for one in laws:
        other = one.fit.amplitude(x - damping.t0)
        own = 2.0 * factor.value * other * one.fit.u_amplitude(x - damping.t0)
        variance += one.weight * (own**2 + (factor.value * other**2 - energy) ** 2)
    points = factor.value * demodulated.amplitude**2
    return Curve(
        x,
        energy,
        np.sqrt(variance),
        unit,
        t,
        points,
        2.0 * factor.value * np.abs(demodulated.amplitude) * damping.scatter.u,
    )


def drag_curve(damping: Damping, demodulated: Demodulated, factor: Estimate, laws: Sequence[Weighted]) -> Curve | None:
    """Return the drag coefficient against amplitude; None if the amplitude does not decrease.

    The curve is the coefficient with which purely quadratic drag would dissipate the same energy in one cycle:
    :math:`C(A) = F\\,(-\\dot A - \\mu)/A^2`. Friction is no drag, so the friction of the selected law, if it has any,
    is subtracted. All other losses are included, also those in the spring. The points come from slopes of ln A over
    groups of windows.
    """
    best = damping.best
    elapsed = demodulated.t - damping.t0
    fitted = best.amplitude(elapsed)
    least, most = float(np.min(fitted)), float(np.max(fitted))
    if not (0.0 < least < most):
        return None
    # Amplitudes beyond the record would be extrapolated; a logarithmic spacing shows small amplitudes too.
    x = np.geomspace(least, most, POINTS)

    def coefficient(fit: LawFit, theta: F8) -> F8:
        friction = _friction(best, theta if fit.name == best.name else best.joint.values)
        return factor.value * (-fit.law.rate(x, theta) - friction) / x**2

    y = coefficient(best, best.joint.values)
    variance = (y * factor.u / factor.value) ** 2
    for fit, weight in ((one.fit, one.weight) for one in laws):
        gradient = fit.by_parameters(functools.partial(coefficient, fit))
        own = np.einsum("in,ij,jn->n", gradient, fit.joint.covariance, gradient)
        variance += weight * (np.maximum(own, 0.0) + (coefficient(fit, fit.joint.values) - y) ** 2)
    return Curve(x, y, np.sqrt(variance), "", *_local_drag(damping, demodulated, factor.value))


def _friction(fit: LawFit, theta: F8) -> float:
    return 0.0 if fit.drag_term("mu") is None else float(theta[fit.joint.names.index("mu")])


def _local_drag(damping: Damping, demodulated: Demodulated, factor: float) -> tuple[F8, F8, F8]:
    """Return amplitude, drag coefficient and its scatter for groups of windows, without assuming a law of drag."""
    kept = damping.scatter.kept
    t, amplitude, u = demodulated.t[kept], demodulated.amplitude[kept], damping.scatter.u[kept]
    groups = min(GROUPS, t.size // FEWEST_FOR_LINE)
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
