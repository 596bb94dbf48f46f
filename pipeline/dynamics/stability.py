"""How large a step may be: the step's matrix on the linear oscillator, its limits, and the map of them.

A method that repeats a linear map grows without bound where an eigenvalue of that map leaves the unit circle. Lengths
of time are in units of the undamped radian, 1 / omega: ``x`` is omega h, ``ratio`` is gamma / omega.
"""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING

import numpy as np

from pipeline.dynamics.equation import Equation
from pipeline.track import F8

if TYPE_CHECKING:
    from pipeline.dynamics.integrators.one_step import OneStep

__all__ = ["growth_per_step", "limit_by_search", "step_matrix"]

GREATEST = 20.0  # largest x that is looked at
LOOKS, REFINEMENTS = 250, 6  # each narrows the bracket 249-fold
_ROUNDING = 1e-12


def step_matrix(method: OneStep, x: float | F8, ratio: float) -> F8:
    """Return the (2, 2) matrix of one step of x = omega h on (y, v / omega) at a damping ratio.

    Parameters
    ----------
    method : OneStep
    x : float or (n,) float64
        Step in radians; of several the matrices come as (n, 2, 2).
    ratio : float
        gamma / omega.

    Examples
    --------
    >>> from pipeline.dynamics.integrators.euler import FORWARD_EULER
    >>> step_matrix(FORWARD_EULER, 0.5, 0.0)
    array([[ 1. ,  0.5],
           [-0.5,  1. ]])
    """
    with np.errstate(all="ignore"):
        step = method.make(Equation(angular_frequency_per_s=1.0, gamma_per_s=ratio), x)
        return np.array([step(1.0, 0.0), step(0.0, 1.0)]).T


def growth_per_step(method: OneStep, x: float, ratio: float) -> float:
    """Return the spectral radius of a step: above 1 the motion grows.

    Examples
    --------
    >>> from pipeline.dynamics.integrators.euler import FORWARD_EULER
    >>> growth_per_step(FORWARD_EULER, 0.75, 0.0)
    1.25
    """
    return float(_growths(step_matrix(method, x, ratio)))


def _growths(matrices: F8) -> F8:
    """Spectral radii of matrices (..., 2, 2); inf where one is not finite."""
    a, b, c, d = (matrices[..., i, j] for i in (0, 1) for j in (0, 1))
    with np.errstate(all="ignore"):
        under = 0.25 * (a - d) ** 2 + b * c
        turning = np.sqrt(np.abs(a * d - b * c))
        growth = np.where(under < 0, turning, np.abs(0.5 * (a + d)) + np.sqrt(np.abs(under)))
    return np.where(np.isfinite(growth), growth, np.inf)


@functools.lru_cache(maxsize=4096)
def limit_by_search(method: OneStep, ratio: float) -> float:
    """Return the largest stable x = omega h at a damping ratio: the end of the first stable interval.

    Examples
    --------
    >>> from pipeline.dynamics.integrators.runge_kutta import RK4
    >>> round(limit_by_search(RK4, 0.0), 4)
    2.8284
    """

    steps = np.geomspace(1e-3 / max(ratio, 1.0), GREATEST, LOOKS)
    low, high = 0.0, math.inf
    for _ in range(REFINEMENTS):
        grows = _growths(step_matrix(method, steps, ratio)) > 1.0 + _ROUNDING
        bad = int(np.argmax(grows))
        if not grows[bad]:
            # The end of a finer look is the step that grew in the coarser.
            return float(steps[-1]) if math.isfinite(high) else math.inf
        low, high = (float(steps[bad - 1]) if bad else low), float(steps[bad])
        steps = np.linspace(low, high, LOOKS)
    return low
