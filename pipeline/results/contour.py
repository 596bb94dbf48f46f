"""The region of two parameters of a damping law: by the covariance, and by the profile of chi-square.

The border of a region of probability P is where chi-square, minimised over all other parameters, is above its minimum
by the quantile of P for two degrees of freedom: 2.30 for 68.3 % (Particle Data Group, Phys. Rev. D 110 (2024) 030001,
section 40.4.2.2). With the covariance it is an ellipse.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.damping.average import scaled
from pipeline.damping.law_fit import LawFit
from pipeline.motion.fitted import Oscillation
from pipeline.numerics.least_squares import EPS, PRECISION, minimise, remembering
from pipeline.numerics.levels import NEGLIGIBLE
from pipeline.numerics.regression import chi2_quantile
from pipeline.results.derive import in_true_units
from pipeline.track import F8

# Number of directions in which a border is searched; straight lines between them miss an ellipse by 0.2 % of its size,
# by the formula 1 - cos(pi/48).
DIRECTIONS = 48
# Standard uncertainties beyond which no border is searched because chi-square does not bound the parameter. The number
# is chosen, ten times what a figure shows.
UNBOUNDED = 50.0


@dataclass(frozen=True, slots=True, eq=False)
class Contour:
    """The borders of regions of two parameters of the selected law, in true seconds and metres."""

    names: tuple[str, str]
    units: tuple[str, str]
    correlation: float
    centre: F8  # (2,)
    ellipses: F8  # (regions, n, 2) by the covariance
    profiles: F8 | None  # (regions, n, 2) by chi-square; None where it is a parabola, or the fit is not to amplitudes


def contour(motion: Oscillation, scales: tuple[float, float], shares: tuple[float, ...]) -> Contour | None:
    """Return regions of the two parameters of the selected law that are correlated most; None if no two are uncertain.

    ``scales`` convert rates and lengths of the record, as in :class:`~pipeline.results.derive.Derived`. A profile is
    given if a border lies elsewhere than the ellipse by more than a tenth of the uncertainty.
    """
    fit = scaled(motion.damping.best)
    joint, size = fit.joint, np.abs(np.tril(fit.joint.correlation, -1))
    second, first = map(int, np.unravel_index(int(np.argmax(size)), size.shape))
    pair = [first, second]
    covariance = joint.covariance[np.ix_(pair, pair)]
    if first == second or not np.diag(covariance).all() or not size[second, first] < 1.0 - EPS:
        return None
    turns = np.linspace(0.0, 2.0 * np.pi, DIRECTIONS + 1)
    # One standard uncertainty in every direction, so that the search begins with steps of like size.
    reach = np.stack([np.cos(turns), np.sin(turns)], axis=1) @ np.linalg.cholesky(covariance).T
    levels = np.array([chi2_quantile(share, 2.0) for share in shares])
    radii, profiles = np.outer(np.sqrt(levels), np.ones(turns.size)), None

    def border(radius: F8) -> F8:
        values: list[Any] = list(joint.values)
        values[first], values[second] = np.moveaxis(joint.values[pair] + radius[..., None] * reach, -1, 0)
        found = in_true_units(fit.law, joint, values, *scales)
        return np.stack([found[joint.names[i]][0] for i in pair], axis=-1)

    if motion.method == "windows":
        rise = _rise(motion, fit, pair)
        found = np.array([[_radius(rise, step, level) for step in reach] for level in levels])
        if not np.max(np.abs(found - radii)) <= NEGLIGIBLE:
            profiles = border(found)
    return Contour(
        names=(joint.names[first], joint.names[second]),
        units=(joint.units[first], joint.units[second]),
        correlation=float(joint.correlation[second, first]),
        centre=border(np.zeros(turns.size))[0],
        ellipses=border(radii),
        profiles=profiles,
    )


def _rise(motion: Oscillation, fit: LawFit, pair: list[int]) -> Callable[[F8], float]:
    """Return how much chi-square is above its minimum where two parameters differ from theirs and the others follow."""
    scatter, best = motion.damping.scatter, fit.joint
    t, y, u = (x[scatter.kept] for x in (motion.windows.t - motion.damping.t0, motion.windows.amplitude, scatter.u))
    others = [i for i in range(best.values.size) if i not in pair]
    # If the two change, the others follow along the regression line at first.
    follow = np.linalg.solve(best.covariance[np.ix_(pair, pair)], best.covariance[np.ix_(pair, others)])

    @remembering
    def deviation(theta: F8) -> tuple[F8, F8]:
        amplitude, slopes = fit.law.curve(t, theta)
        return (amplitude - y) / u, slopes / u[:, None]

    residual, slopes = deviation(best.values)
    least = float(residual @ residual)
    # Correlation and misfit widen the covariance, and chi-square counts less by the same factor.
    widened = float(np.trace(slopes.T @ slopes @ best.covariance)) / best.values.size

    def rise(step: F8) -> float:
        theta = best.values.copy()
        theta[pair] += step

        def at(values: F8) -> F8:
            theta[others] = values
            return theta

        start = best.values[others] + step @ follow
        if not others:
            return (float(np.sum(deviation(theta)[0] ** 2)) - least) / widened
        found = minimise(lambda x: deviation(at(x))[0], start, lambda x: deviation(at(x))[1][:, others])
        return (found.cost - least) / widened

    return rise


def _radius(rise: Callable[[F8], float], reach: F8, level: float) -> float:
    """Return the multiple of a step at which chi-square has risen by a level; NaN if it does not rise that much."""
    from scipy.optimize import brentq

    # Along a parabola the root of the rise is a straight line, which the first step of the search follows to its zero.
    def above(radius: float) -> float:
        return math.sqrt(max(rise(radius * reach), 0.0)) - math.sqrt(level) if radius else -math.sqrt(level)

    far = 1.1 * math.sqrt(level)
    with np.errstate(all="ignore"):
        while (end := above(far)) < 0.0:
            far *= 1.5
            if far > UNBOUNDED:
                return math.nan
        return float(brentq(above, 0.0, far, xtol=PRECISION)) if math.isfinite(end) else math.nan
