"""What rounding leaves of a motion in double precision."""

from __future__ import annotations

import numpy as np

from pipeline.dynamics.problem import Problem

__all__ = ["least_tolerance", "rounding_error"]

EPS = float(np.finfo(np.float64).eps)
LEAST_TOLERANCE = 1e-13


def rounding_error(problem: Problem, seconds: float) -> float:
    """Return the most that rounding of the phase leaves, over the amplitude.

    Notes
    -----
    The phase :math:`\\omega t` is a product of rounded numbers: its error is its own size times the relative rounding,
    and the displacement is rounded too.
    """
    return EPS * (4.0 + problem.equation.angular_frequency_per_s * seconds)


def least_tolerance(problem: Problem, seconds: float) -> float:
    """Return the least tolerance that can be kept: twice the rounding of the phase, or 1e-13.

    Examples
    --------
    >>> from pipeline.dynamics.equation import Equation
    >>> least_tolerance(Problem(Equation(angular_frequency_per_s=8.66), 0.05), 120.0) < 1e-12
    True
    """
    return max(LEAST_TOLERANCE, 2.0 * rounding_error(problem, seconds))
