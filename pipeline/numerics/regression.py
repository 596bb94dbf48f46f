"""Weighted regression on the windows' points, allowing for scatter beyond the stated noise and for correlation."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Legendre
from numpy.typing import NDArray

from pipeline.numerics.levels import FEWEST_FOR_CURVE, FEWEST_FOR_MEDIAN, OUTLIER
from pipeline.numerics.robust import mad_sigma, median
from pipeline.track import F8

# Maximum degree of the polynomial that is the smooth curve through a run. It follows a decay to a seventh within 3e-6
# of the start and to a twentieth within 3e-5, measured by ``numpy.polynomial.Legendre.fit``.
DEGREE = 6


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A weighted linear least-squares solution."""

    values: F8  # (p,)
    covariance: F8  # (p, p) from the stated standard uncertainties, without scaling
    residual: F8  # (n,)
    chi2: float

    def widening(self, correlation: float) -> float:
        """Return the factor of the covariance if several points count as one, and chi-square per freedom exceeds 1."""
        return correlation * max(1.0, self.chi2 / max(self.residual.size - self.values.size, 1))


@dataclass(frozen=True, slots=True, eq=False)
class Scatter:
    """Scatter of points about a smooth curve, independent of the law that they follow."""

    u: F8  # (n,) standard uncertainty of each point, with the excess added in quadrature
    excess: float  # scatter of the points beyond their own noise: beats, sideways swing, steps
    kept: NDArray[np.bool_]  # (n,) False for single points more than five standard uncertainties from the curve
    correlation: float  # number of points that count as one, :math:`1 + 2\\sum\\rho_k \\ge 1`


def beyond(basis: F8, columns: F8) -> F8:
    """Return the component of columns (n, k) orthogonal to an orthonormal basis (n, p)."""
    left = columns - basis @ (basis.T @ columns)
    # Where columns nearly lie in the basis, a second projection removes what rounding has left.
    return np.asarray(left - basis @ (basis.T @ left))


def solve_weighted(design: F8, y: F8, u: F8) -> Line:
    """Solve :math:`y = X\\theta` with standard uncertainties ``u``.

    Where columns are linearly dependent, the result is the minimum-norm solution for columns scaled to unit length.
    """
    weight = 1.0 / u
    left, root, _ = decompose(design * weight[:, None])
    values = root @ (left.T @ (y * weight))
    residual = y - design @ values
    deviation = residual * weight
    return Line(values, root @ root.T, residual, float(deviation @ deviation))


def decompose(matrix: F8, least: float = 1e-13) -> tuple[F8, F8, bool]:
    """Return factors of the pseudo-inverse of a matrix with more rows than columns and any units.

    The first factor has orthonormal columns that span the column space. The second, multiplied by its transpose, gives
    :math:`(J^T J)^{-1}`, and multiplied by that of the first the pseudo-inverse. Then follows whether no singular
    value, of the columns scaled to unit length and relative to the largest, is below ``least`` and counts as zero.
    """
    scale = np.sqrt(np.einsum("np,np->p", matrix, matrix))
    scale[scale == 0.0] = 1.0
    left, singular, right = np.linalg.svd(matrix / scale, full_matrices=False)
    # Singular values come in descending order.
    seen = int(np.count_nonzero(singular > least * singular[0]))
    return left[:, :seen], (right[:seen] / singular[:seen, None]).T / scale[:, None], seen == scale.size


def covariance_of(jacobian: F8) -> F8:
    """Return the covariance :math:`(J^T J)^{-1}` of a least-squares solution; infinite if one is undetermined."""
    unknown = np.full((jacobian.shape[1],) * 2, np.inf)
    if not np.all(np.isfinite(np.linalg.norm(jacobian, axis=0))):
        return unknown
    _, root, independent = decompose(jacobian)
    return root @ root.T if independent else unknown


def degree_of_curve(points: int) -> int:
    """Return the degree of a polynomial through points, of which three show a straight line."""
    return min(DEGREE, max(points // 4 - 1, int(points >= FEWEST_FOR_MEDIAN)))


def scatter(t: F8, y: F8, u: F8) -> Scatter:
    """Measure the scatter of points about a smooth curve that is independent of any damping law.

    The excess, added in quadrature, makes the uncertainties agree with the spread of the residuals, which is corrected
    for the number of coefficients. The spread is the smaller of the median's and the root mean square. With fewer than
    eight points nothing is measured and ``u`` is kept.
    """
    n = t.size
    degree = degree_of_curve(n)
    everything = np.ones(n, np.bool_)
    if n < FEWEST_FOR_CURVE:
        return Scatter(u, 0.0, everything, 1.0)
    design = np.polynomial.legendre.legvander(2.0 * (t - t[0]) / (t[-1] - t[0]) - 1.0, degree)
    share = math.sqrt(n / (n - degree - 1))
    total, excess, kept = u, 0.0, everything
    for _ in range(4):
        weight = 1.0 / total[kept]
        values = np.linalg.lstsq(design[kept] * weight[:, None], y[kept] * weight, rcond=None)[0]
        residual = y - design @ values
        # The smaller of two measures: the median is robust against outliers, the root mean square suits flat patterns.
        typical = mad_sigma(residual)
        believed = residual[kept]
        spread = share * min(typical, math.sqrt(float(believed @ believed) / believed.size))
        excess = _excess(residual, u, spread)
        settled = excess == 0.0 and total is u
        total = np.hypot(u, excess) if excess else u
        before, kept = kept, np.abs(residual) <= OUTLIER * np.maximum(total, 1e-300)
        if settled and np.array_equal(before, kept):
            break
        if np.count_nonzero(kept) <= degree + 2:
            kept = everything
            break
    return Scatter(total, excess, kept, correlation_length(residual[kept] / total[kept]))


def smooth_curve(t: F8, y: F8, spread: Scatter) -> tuple[Legendre, float]:
    """Return a polynomial through points, and the amount by which its BIC is below that of the mean."""
    kept = spread.kept
    values, weight = y[kept], 1.0 / spread.u[kept]
    mean = float(np.average(values, weights=weight**2))
    order = degree_of_curve(t.size)
    if order < 1:
        return Legendre([mean]), 0.0
    ends = [float(t[0]), float(t[-1])]
    curve = Legendre.fit(t[kept], values, order, domain=ends, w=weight)
    chi2, of_mean = (float(np.sum(((values - at) * weight) ** 2)) for at in (curve(t[kept]), mean))
    price = order * math.log(max(values.size / spread.correlation, 2.0))
    return curve, (of_mean - chi2) / spread.correlation - price


def _excess(residual: F8, u: F8, spread: float) -> float:
    typical = median(u)
    # For white noise the smaller of both measures exceeds this with a probability of 0.6 %, for 10 to 1000 points.
    if spread <= typical * (1.0 + 1.65 / math.sqrt(residual.size)):
        return 0.0
    return math.sqrt(spread**2 - typical**2)


def correlation_length(residual: F8) -> float:
    """Return how many points count as one: :math:`1 + 2\\sum_k \\rho_k` before the first insignificant lag."""
    n = residual.size
    if n < 8:
        return 1.0
    centred = residual - residual.sum() / n
    power = float(centred @ centred)
    if power == 0.0:
        return 1.0
    total, least = 1.0, 2.0 * power / math.sqrt(n)
    for lag in range(1, n // 3):
        product = float(centred[lag:] @ centred[:-lag])
        if product < least:
            break
        total += 2.0 * product / power
    return total


def chi2_quantile(probability: float, dof: float) -> float:
    """Return the quantile of the chi-square distribution.

    >>> round(chi2_quantile(0.999, 10), 1)
    29.6
    """
    from scipy.special import chdtri

    return float(chdtri(dof, 1.0 - probability))
