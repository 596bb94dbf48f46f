"""A smooth curve through points, where they ask for more than their mean."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.numerics.regression import Line, Scatter, scatter, smooth_columns, solve_weighted
from pipeline.track import F8

__all__ = ["SmoothCurve", "fit_curve"]


@dataclass(frozen=True, slots=True, eq=False)
class SmoothCurve:
    """Points' mean, and the polynomial that they may follow instead.

    Parameters
    ----------
    spread : Scatter
        Of the points about a smooth curve.
    constant : Line
        The mean of those kept.
    coefficients : (p,) float64
        Of Legendre's polynomials from the first time to the last; the mean alone where points are few.
    first, last : float
        Times.
    bends : bool
        Whether the points ask for the polynomial: whether it lowers the BIC by as much as was demanded.
    """

    spread: Scatter
    constant: Line
    coefficients: F8
    first: float
    last: float
    bends: bool

    def at(self, t: F8) -> F8:
        """Return the polynomial at times of any shape."""
        place = 2.0 * (t - self.first) / (self.last - self.first) - 1.0
        return np.asarray(np.polynomial.legendre.legval(place, self.coefficients))


def fit_curve(t: F8, y: F8, u: F8, *, degree: int = 6, evidence: float = 10.0) -> SmoothCurve:
    """Fit a constant and a polynomial to points.

    Parameters
    ----------
    t, y, u : (n,) float64
        Times in ascending order, values and their standard uncertainties.
    degree : int
        Of the polynomial, fewer where points are few (one coefficient for four points).
    evidence : float
        By how much the polynomial must lower the BIC; points that are correlated count as fewer.
    """
    spread = scatter(t, y, u, degree=degree)
    kept = spread.kept
    constant = solve_weighted(np.ones((int(kept.sum()), 1)), y[kept], spread.u[kept])
    order = min(degree, t.size // 4 - 1)
    if order < 1:
        return SmoothCurve(spread, constant, constant.values, float(t[0]), float(t[0]) + 1.0, False)
    line = solve_weighted(smooth_columns(t, order)[kept], y[kept], spread.u[kept])
    gain = (constant.chi2 - line.chi2) / spread.correlation
    price = order * math.log(max(kept.sum() / spread.correlation, 2.0))
    return SmoothCurve(spread, constant, line.values, float(t[0]), float(t[-1]), bool(gain - price > evidence))
