"""Largest stable step: closed forms for both Euler methods, and a search on the step matrix for the other methods.

The solution of a method that repeats a linear map grows without bound if an eigenvalue of the map lies outside the
unit circle. Times are in units of 1 / omega, an undamped radian: ``x`` is omega h, ``ratio`` is gamma / omega.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from pipeline.dynamics.equation import Equation
from pipeline.dynamics.integrator import StepMaker
from pipeline.track import F8

__all__ = ["forward_euler_limit", "limit_by_search", "step_matrix", "symplectic_euler_limit"]

GREATEST = 20.0  # maximum x of the search
LOOKS, REFINEMENTS = 250, 6  # points of a scan, and number of scans; each further scan narrows the bracket 249-fold
_ROUNDING = 1e-12


def forward_euler_limit(omega: float, gamma: float) -> float:
    """Return the largest stable step of forward Euler in s, from angular frequency and damping rate in 1/s.

    The eigenvalues :math:`1 + h\\lambda` stay in the unit circle up to
    :math:`h = -2\\,\\mathrm{Re}\\lambda/|\\lambda|^2`.
    """
    if gamma < omega:
        return 2.0 * gamma / omega**2
    return 2.0 / (gamma + math.sqrt((gamma - omega) * (gamma + omega)))


def symplectic_euler_limit(omega: float, gamma: float) -> float:
    """Return the largest stable step of symplectic Euler in s, from angular frequency and damping rate in 1/s.

    Both roots of the step's characteristic polynomial stay in the unit circle if
    :math:`(\\omega h)^2 + 4\\gamma h < 4`.
    """
    return 2.0 / (gamma + math.hypot(gamma, omega))


def step_matrix(make: StepMaker, x: float | F8, ratio: float) -> F8:
    """Return the (2, 2) matrix that advances (y, v / omega) by one step of x = omega h at a damping ratio.

    Parameters
    ----------
    make : callable
        Takes an equation and a step, and returns the function of one step.
    x : float or (n,) float64
        Step in radians; for an array of steps the result is (n, 2, 2).
    ratio : float
        Damping ratio gamma / omega.

    Examples
    --------
    >>> from pipeline.dynamics.methods import FORWARD_EULER
    >>> step_matrix(FORWARD_EULER.make, 0.5, 0.0)
    array([[ 1. ,  0.5],
           [-0.5,  1. ]])
    """
    with np.errstate(all="ignore"):
        step = make(Equation(angular_frequency_per_s=1.0, gamma_per_s=ratio), x)
        return np.array([step(1.0, 0.0), step(0.0, 1.0)]).T


def _growths(matrices: F8) -> F8:
    """Return the spectral radii of matrices (..., 2, 2); inf for a matrix that is not finite."""
    finite = np.asarray(np.isfinite(matrices).all(axis=(-2, -1)))
    values = np.linalg.eigvals(np.where(finite[..., None, None], matrices, 0.0))
    return np.asarray(np.where(finite, np.abs(values).max(axis=-1), np.inf))


@functools.lru_cache(maxsize=4096)
def limit_by_search(make: StepMaker, ratio: float) -> float:
    """Return the largest stable x = omega h at a damping ratio: the upper end of the first stable interval.

    Examples
    --------
    >>> from pipeline.dynamics.methods import RK4
    >>> round(limit_by_search(RK4.make, 0.0), 4)
    2.8284
    """

    steps = np.geomspace(1e-3 / max(ratio, 1.0), GREATEST, LOOKS)
    low, high = 0.0, math.inf
    for _ in range(REFINEMENTS):
        grows = _growths(step_matrix(make, steps, ratio)) > 1.0 + _ROUNDING
        bad = int(np.argmax(grows))
        if not grows[bad]:
            # The upper end of a finer scan is the step that was unstable in the coarser one.
            return float(steps[-1]) if math.isfinite(high) else math.inf
        low, high = (float(steps[bad - 1]) if bad else low), float(steps[bad])
        steps = np.linspace(low, high, LOOKS)
    return low
