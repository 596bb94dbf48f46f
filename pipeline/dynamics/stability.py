"""How large a step may be: closed limits of the two Eulers, and a search on the matrix of a step for any other.

A method that repeats a linear map grows without bound where an eigenvalue of that map leaves the unit circle. Lengths
of time are in units of the undamped radian, 1 / omega: ``x`` is omega h, ``ratio`` is gamma / omega.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from pipeline.dynamics.equation import Equation
from pipeline.dynamics.integrator import StepMaker
from pipeline.track import F8

__all__ = ["forward_euler_limit", "limit_by_search", "step_matrix", "symplectic_euler_limit"]

GREATEST = 20.0  # largest x that is looked at
LOOKS, REFINEMENTS = 250, 6  # each narrows the bracket 249-fold
_ROUNDING = 1e-12


def forward_euler_limit(omega: float, gamma: float) -> float:
    """Return the largest stable step of forward Euler, s, from frequency and damping, 1/s.

    Eigenvalues :math:`1 + h\\lambda` stay in the unit circle up to :math:`-2\\,\\mathrm{Re}\\lambda/|\\lambda|^2`.
    """
    if gamma < omega:
        return 2.0 * gamma / omega**2
    return 2.0 / (gamma + math.sqrt((gamma - omega) * (gamma + omega)))


def symplectic_euler_limit(omega: float, gamma: float) -> float:
    """Return the largest stable step of symplectic Euler, s, from frequency and damping, 1/s.

    Both roots of the step's characteristic polynomial stay in the circle: :math:`(\\omega h)^2 + 4\\gamma h < 4`.
    """
    return 2.0 / (gamma + math.hypot(gamma, omega))


def step_matrix(make: StepMaker, x: float | F8, ratio: float) -> F8:
    """Return the (2, 2) matrix of one step of x = omega h on (y, v / omega) at a damping ratio.

    Parameters
    ----------
    make : callable
        Equation and step to the function of one step.
    x : float or (n,) float64
        Step in radians; of several the matrices come as (n, 2, 2).
    ratio : float
        gamma / omega.

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
    """Spectral radii of matrices (..., 2, 2); inf where one is not finite."""
    finite = np.asarray(np.isfinite(matrices).all(axis=(-2, -1)))
    values = np.linalg.eigvals(np.where(finite[..., None, None], matrices, 0.0))
    return np.asarray(np.where(finite, np.abs(values).max(axis=-1), np.inf))


@functools.lru_cache(maxsize=4096)
def limit_by_search(make: StepMaker, ratio: float) -> float:
    """Return the largest stable x = omega h at a damping ratio: the end of the first stable interval.

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
            # The end of a finer look is the step that grew in the coarser.
            return float(steps[-1]) if math.isfinite(high) else math.inf
        low, high = (float(steps[bad - 1]) if bad else low), float(steps[bad])
        steps = np.linspace(low, high, LOOKS)
    return low
