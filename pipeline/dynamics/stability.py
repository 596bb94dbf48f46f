"""How large a step may be: the step's matrix on the linear oscillator, its limits, and the map of them.

A method that repeats a linear map grows without bound where an eigenvalue of that map leaves the unit circle. Lengths
of time are in units of the undamped radian, 1 / omega: ``x`` is omega h, ``ratio`` is gamma / omega.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from pipeline.dynamics.equation import Equation
from pipeline.dynamics.integrator import Integrator, StepMaker
from pipeline.dynamics.problem import Problem
from pipeline.errors import DynamicsError
from pipeline.track import F8

__all__ = ["growth_per_step", "limit_by_search", "limits", "runs_bounded", "step_matrix"]

RUN_STEPS = 4000
GREATEST = 20.0  # largest x that is looked at
LOOKS, REFINEMENTS = 250, 6  # each narrows the bracket 249-fold
_ROUNDING = 1e-12


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
    >>> from pipeline.dynamics.integrators.euler import FORWARD_EULER
    >>> step_matrix(FORWARD_EULER.make, 0.5, 0.0)
    array([[ 1. ,  0.5],
           [-0.5,  1. ]])
    """
    with np.errstate(all="ignore"):
        step = make(Equation(angular_frequency_per_s=1.0, gamma_per_s=ratio), x)
        return np.array([step(1.0, 0.0), step(0.0, 1.0)]).T


def growth_per_step(make: StepMaker, x: float, ratio: float) -> float:
    """Return the spectral radius of a step: above 1 the motion grows.

    Examples
    --------
    >>> from pipeline.dynamics.integrators.euler import FORWARD_EULER
    >>> growth_per_step(FORWARD_EULER.make, 0.75, 0.0)
    1.25
    """
    return float(_growths(step_matrix(make, x, ratio)))


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
    >>> from pipeline.dynamics.integrators.runge_kutta import RK4
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


def limits(integrator: Integrator, ratios: F8) -> F8:
    """Return the largest stable omega h at each damping ratio gamma / omega, (n,) float64; inf where there is none.

    Examples
    --------
    >>> from pipeline.dynamics.integrators.euler import SYMPLECTIC_EULER
    >>> limits(SYMPLECTIC_EULER, np.array([0.0, 1.0])).round(3)
    array([2.   , 0.828])
    """
    problems = [Problem(Equation(angular_frequency_per_s=1.0, gamma_per_s=float(ratio)), 1.0) for ratio in ratios]
    return np.array([integrator.stable_step(problem) for problem in problems])


def runs_bounded(integrator: Integrator, x: float, ratio: float) -> bool:
    """Return whether a run of many steps of x = omega h ends with no more energy than it began with.

    A step just inside the limit may swell before it settles, so the energy is looked at after the first half only.
    """
    problem = Problem(Equation(angular_frequency_per_s=1.0, gamma_per_s=ratio), 1.0)
    try:
        run = integrator.run(problem, x, RUN_STEPS, every=RUN_STEPS // 2)
        middle, end = run.relative_energy()[1:]
    except DynamicsError:
        return False
    return bool(end <= middle * (1.0 + 1e-9) and math.isfinite(end))
