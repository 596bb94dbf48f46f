"""Non-linear least squares by MINPACK, with certified convergence.

The convergence tests of ``scipy.optimize.leastsq`` ask how small a step or a gain is. On NIST's reference data, fitters
with such tests report success at a wrong end for up to 23 of 54 starts (docs/decisions/0012-scipy-least-squares.md).
Here a fit has converged only if Bates and Watts' relative offset shows a minimum and the singular values of the
Jacobian show that the data determine every parameter: ``tests/reference/test_nist.py`` shows six correct digits from 53
of the 54 starts and no false success.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from pipeline.numerics.regression import decompose
from pipeline.track import F8

T = TypeVar("T")

EPS = float(np.finfo(np.float64).eps)
# Relative step at which a central difference has its minimum error, about the square of the step: W. H. Press et al.,
# "Numerical Recipes", 3rd ed., 2007, section 5.7.
CENTRAL_STEP = EPS ** (1.0 / 3.0)
# Remaining step over the standard uncertainties, which then grow by 0.005 % (Bates and Watts (1981), as below).
PRECISION = 0.01
STEPS = 60  # maximum number of trial steps; measured: of the fits that converged on 96 recordings two took more than 40


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """The result of a fit."""

    values: F8  # (p,)
    # (p, p) :math:`(J^T J)^{-1}`, for residuals in units of their standard uncertainties. Multiply it by ``cost / (n -
    # p)`` if the uncertainties are known only up to a factor. NaN if the fit has not converged.
    covariance: F8
    residual: F8  # (n,) residuals at ``values``
    cost: float  # sum of squared residuals
    converged: bool
    tried: str  # what was done and how it ended, worded for a finding


def minimise(
    residuals: Callable[[F8], F8],
    start: ArrayLike,
    jacobian: Callable[[F8], F8] | None = None,
    *,
    precision: float = PRECISION,
    steps: int = STEPS,
) -> Fit:
    """Find the parameters that minimise the sum of squared residuals.

    Check ``converged`` before using the numbers. ``residuals`` gives at least as many differences of model and data
    over the standard uncertainty as parameters; where the model has no value it may be non-finite. ``jacobian`` is by
    central differences, accurate to about ten digits, if there is none. The search stops when the remaining step is
    ``precision`` of the parameters' standard uncertainties, as estimated from the residuals; 1e-8 is for reference
    values.

    Where the relative offset is ``precision``, the remaining step lowers the sum of squares by the fraction
    :math:`\\mathrm{precision}^2 p/(n-p)`, which is the search's tolerance. The end is judged by the offset itself [1]_:
    the length of the residuals' projection on the columns of the Jacobian, relative to the length of the residuals,
    which does not depend on the units of the parameters. An offset within rounding error is accepted too.

    .. [1] D. M. Bates, D. G. Watts, "A relative offset orthogonality convergence criterion for nonlinear least
       squares", Technometrics 23 (1981) 179, doi:10.1080/00401706.1981.10486257.

    >>> t = np.linspace(0, 5, 50)
    >>> fit = minimise(lambda b: b[0] * np.exp(-b[1] * t) - 3.0 * np.exp(-0.7 * t), [1.0, 0.0])
    >>> fit.converged, fit.values.round(9)
    (True, array([3. , 0.7]))
    """
    theta = np.array(start, np.float64, ndmin=1)
    with np.errstate(all="ignore"):
        residual = np.asarray(residuals(theta), np.float64)
        if residual.size < theta.size or theta.size == 0:
            raise ValueError(f"a fit needs as many residuals as parameters, got {residual.size} for {theta.size}")
        if not np.all(np.isfinite(residual)):
            return _failed(theta, residual, f"no finite value at {_shown(theta)}")
        slopes = jacobian or (lambda at: central_differences(residuals, at))
        return _searched(residuals, slopes, theta, residual, precision, steps)


def _searched(
    residuals: Callable[[F8], F8], jacobian: Callable[[F8], F8], theta: F8, residual: F8, precision: float, steps: int
) -> Fit:
    """Search downhill from a start with known residuals, and judge the end point."""
    from scipy.optimize import leastsq

    largest, start = np.zeros(theta.size), theta.tobytes()

    def values(at: F8) -> F8:
        # A copy, because MINPACK overwrites the first array that it receives.
        return residual.copy() if at.tobytes() == start else residuals(at)

    derivatives = remembering(lambda at: np.asarray(jacobian(at), np.float64))

    def slopes(at: F8) -> F8:
        slope = derivatives(at)
        if not np.isfinite(slope).all():
            return np.zeros_like(slope)  # which ends the search
        np.maximum(largest, _lengths(slope), out=largest)
        return slope

    share = precision**2 * theta.size / max(residual.size - theta.size, 1)
    ends = {"ftol": max(share, EPS), "xtol": EPS, "gtol": EPS, "maxfev": steps}
    x, _, report, *_ = leastsq(values, theta, Dfun=slopes, full_output=True, **ends)
    slope = derivatives(x)
    if not np.isfinite(slope).all():
        return _failed(x, report["fvec"], f"no finite derivative at {_shown(x)}")
    # Where the search finds no further step, its end may be less precise than where it runs out of steps.
    precision = precision if report["nfev"] >= steps else max(precision, PRECISION)
    return _judged(x, report["fvec"], slope, largest, report["nfev"], precision)


def _judged(values: F8, residual: F8, slope: F8, largest: F8, steps: int, precision: float) -> Fit:
    """Decide whether an end point is a minimum at which the data determine all parameters."""
    cost, count = float(residual @ residual), values.size
    norms = _lengths(slope)
    noise = np.sqrt(cost * count / max(residual.size - count, 1))
    rounding = 8.0 * EPS * float(np.linalg.norm(norms * values))
    # Derivatives by central differences cannot distinguish smaller contributions from their own error.
    least = CENTRAL_STEP**2
    lost = np.flatnonzero(norms <= least * largest)
    left, root, independent = decompose(slope, least)
    offset = float(np.linalg.norm(left.T @ residual))
    if not offset <= max(precision * noise, rounding):
        ended = f"no minimum in {steps} steps"
    elif lost.size:
        names = ", ".join(str(i + 1) for i in lost)
        ended = f"a minimum after {steps} steps, but there the data do not determine parameter {names}"
    elif not independent:
        ended = f"a minimum after {steps} steps, but there parameters depend on each other"
    else:
        return Fit(values, root @ root.T, residual, cost, True, f"a minimum after {steps} steps")
    return _failed(values, residual, f"{ended}: {_shown(values)}")


def central_differences(function: Callable[[F8], F8], theta: F8) -> F8:
    """Return the derivatives (n, p) of a function from (p,) to (n,); steps are relative, and absolute near zero."""
    columns = []
    for i, value in enumerate(theta.tolist()):
        above, below = theta.copy(), theta.copy()
        step = CENTRAL_STEP * max(abs(value), CENTRAL_STEP)
        above[i] += step
        below[i] -= step
        columns.append((function(above) - function(below)) / (above[i] - below[i]))
    return np.stack(columns, axis=1)


def remembering(function: Callable[[F8], T]) -> Callable[[F8], T]:
    """Cache a function's result for its last parameters, because MINPACK's wrapper evaluates the start twice."""
    last: list[tuple[bytes, T]] = []

    def at(theta: F8) -> T:
        key = theta.tobytes()
        if not last or last[0][0] != key:
            last[:] = [(key, function(theta.copy()))]  # MINPACK overwrites its parameters
        return last[0][1]

    return at


def _lengths(slope: F8) -> F8:
    """Return the lengths (p,) of the columns of a Jacobian (n, p), five times as fast as numpy's norm."""
    return np.asarray(np.sqrt(np.einsum("np,np->p", slope, slope)))


def _failed(values: F8, residual: F8, ended: str) -> Fit:
    cost = float(residual @ residual)
    nothing = np.full((values.size, values.size), np.nan)
    return Fit(values, nothing, residual, cost if np.isfinite(cost) else np.inf, False, ended)


def _shown(theta: F8) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in theta) + ")"
