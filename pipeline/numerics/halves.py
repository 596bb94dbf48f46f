"""Two halves of a run under one model: whether the parameters that it calls constant are the same in both."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pipeline.numerics.regression import beyond, decompose
from pipeline.track import F8

# Share of the information on a combination of parameters below which the other half does not determine it. It is above
# the error of numerical derivatives in double precision, 4e-11 to 1e-7 (Press et al. (2007), section 5.7).
UNDETERMINED = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Points of a fit in the order of time, in standard uncertainties."""

    residual: F8  # (n,)
    slopes: F8  # (n, p) derivatives of the fitted values by the parameters
    correlation: float  # number of points that count as one


class Difference(NamedTuple):
    """The difference of the parameters of both halves: chi-square and the number of parameters."""

    chi2: float
    parameters: int

    @property
    def factor(self) -> float:
        """The factor by which it exceeds that of the stated covariance; at least 1."""
        return max(1.0, self.chi2 / self.parameters) if self.parameters else 1.0


def difference(points: Points, fewest: float) -> Difference | None:
    """Compare the parameters of both halves of equal information; None if one has fewer points than ``fewest``.

    The determinants of :math:`J^T J` are equal for both halves; their difference increases with the size of the first
    one, so it is found by bisection. If all parameters may differ between the halves, chi-square falls by
    :math:`d^T (C_1 + C_2)^{-1} d` for the difference d of the parameters and their covariances C: by the part of the
    residual that lies in the derivatives of one half beyond those of the whole (G. C. Chow, Econometrica 28 (1960)
    591), to first order for a law that is not linear.
    """
    slopes, count = points.slopes, points.residual.size
    if count < 2.0 * fewest:
        return None
    scale = np.linalg.norm(slopes, axis=0)
    slopes = slopes[:, scale > 0.0] / scale[scale > 0.0]
    first, last = int(np.ceil(fewest)), count - int(np.ceil(fewest))
    while first < last:
        middle = (first + last) // 2
        before, after = (np.linalg.slogdet(part.T @ part) for part in (slopes[:middle], slopes[middle:]))
        first, last = (middle + 1, last) if before < after else (first, middle)
    basis, _, _ = decompose(slopes)
    one_half = slopes.copy()
    one_half[:first] = 0.0
    other = beyond(basis, one_half)
    other = other[:, np.linalg.norm(other, axis=0) > UNDETERMINED]
    if not other.size:
        return None
    apart, _, _ = decompose(other, UNDETERMINED)
    part = apart.T @ beyond(basis, points.residual[:, None])[:, 0]
    return Difference(float(part @ part) / points.correlation, part.size)
