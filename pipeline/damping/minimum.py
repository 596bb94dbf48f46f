"""The least chi-square of each damping law on the same points, where it lies and how well it is determined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.damping.laws import Law
from pipeline.numerics import least_squares
from pipeline.numerics.regression import covariance_of
from pipeline.track import F8

__all__ = ["Minimum", "minima_of"]

# A hundredth of a standard uncertainty is left. One method is enough: a law that MINPACK loses has no chance.
OPTIONS = least_squares.Params(precision=0.01, steps=40, again=False)


@dataclass(frozen=True, slots=True, eq=False)
class Minimum:
    """Where the fit of one law ended.

    Parameters
    ----------
    theta : (p,) float64
    covariance : (p, p) float64
        :math:`(J^T J)^{-1}` from the points' standard uncertainties; infinite where they do not determine the law.
    chi2 : float
    converged : bool
    tried : str
        What was tried, for a fit that did not converge.
    """

    theta: F8
    covariance: F8
    chi2: float
    converged: bool
    tried: str


def minima_of(laws: Sequence[Law], t: F8, y: F8, u: F8) -> list[Minimum]:
    """Fit each law to the points by weighted least squares, from the law's own guess.

    Parameters
    ----------
    laws : sequence of Law
        Each with no more parameters than there are points.
    t, y, u : (n,) float64
        Times in s in ascending order, amplitudes and their standard uncertainties in m.

    Returns
    -------
    list of Minimum
        In the order of ``laws``; not finite where a law's numbers ran out of range.

    Notes
    -----
    Amplitudes are counted in units of their root mean square, so that no power of a metre disturbs the search.
    """
    length = float(np.sqrt(np.mean(y * y))) or 1.0
    return [_minimum(law, t, y / length, u / length, length) for law in laws]


def _minimum(law: Law, t: F8, y: F8, u: F8, length_m: float) -> Minimum:
    """Fit one law to points in units of ``length_m``."""

    def both(theta: F8) -> tuple[F8, F8]:
        amplitude, by = law.both(t, theta)
        return (amplitude - y) / u, by / u[:, None]

    residuals, jacobian = least_squares.evaluated_once(both)
    fit = least_squares.minimise(residuals, law.guess(t, y), jacobian, OPTIONS)
    with np.errstate(all="ignore"):
        theta = law.rescaled(fit.values, 1.0 / length_m)
        covariance = covariance_of(law.jacobian(t, theta) / (u[:, None] * length_m))
    note = "" if fit.converged else f"{fit.steps} steps of Levenberg-Marquardt from the law's own guess"
    return Minimum(theta, covariance, fit.cost, fit.converged, note)
