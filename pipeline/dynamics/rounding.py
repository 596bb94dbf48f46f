"""Limits that rounding in double precision sets to the accuracy of a motion."""

from __future__ import annotations

import numpy as np

from pipeline.dynamics.problem import Problem

__all__ = ["least_tolerance", "rounding_error"]

EPS = float(np.finfo(np.float64).eps)
LEAST_TOLERANCE = 1e-13


def rounding_error(problem: Problem, seconds: float) -> float:
    """Return the maximum error of the displacement by rounding of the phase, relative to the amplitude.

    Notes
    -----
    The phase :math:`\\omega t` is a product of rounded numbers, so that its error is the phase times the machine
    epsilon. Rounding of the displacement itself is included.
    """
    return EPS * (4.0 + problem.equation.angular_frequency_per_s * seconds)


def least_tolerance(problem: Problem, seconds: float) -> float:
    """Return the minimum achievable tolerance: twice the rounding error, but at least 1e-13.

    Examples
    --------
    >>> from pipeline.dynamics.equation import Equation
    >>> least_tolerance(Problem(Equation(angular_frequency_per_s=8.66), 0.05), 120.0) < 1e-12
    True
    """
    return max(LEAST_TOLERANCE, 2.0 * rounding_error(problem, seconds))
