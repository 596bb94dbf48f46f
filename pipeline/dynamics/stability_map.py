"""The stability map: how large a step may be at every damping, from theory and by running."""

from __future__ import annotations

import math

import numpy as np

from pipeline.dynamics.equation import Equation, Problem
from pipeline.dynamics.integrator import Integrator
from pipeline.errors import DynamicsError
from pipeline.track import F8

__all__ = ["limits", "runs_bounded"]

RUN_STEPS = 4000


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
