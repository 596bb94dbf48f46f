"""What rounding leaves of a motion: at worst, and as it is to be expected."""

from __future__ import annotations

import functools
import math

import numpy as np

from pipeline.dynamics.prediction.envelope import Envelope, pace_and_shear, slow_rate
from pipeline.dynamics.problem import Problem

__all__ = ["expected_rounding", "rounding_error", "sheared_rounding", "stepped_rounding"]

EPS = float(np.finfo(np.float64).eps)
A_STEP = 0.08  # of the relative rounding: what a step adds whose coefficients are rounded
A_SHEAR = 0.1  # of the relative rounding, times the root of the phase: what scatters in the amplitude
A_SHEAR_AT_TURNS = 0.006  # the same times the phase: what repeats where a step ends at every turning point
TYPICAL = 0.3  # of a product's largest rounding: what it has on the average


def rounding_error(problem: Problem, seconds: float, steps: float = 0.0) -> float:
    """Return the most that rounding leaves, over the amplitude: of the phase, and of steps that repeat.

    Notes
    -----
    The phase :math:`\\omega t` is a product of rounded numbers: its error is its own size times the relative rounding.
    A step that is repeated repeats the rounding of its coefficients: a fifth of the relative rounding each.
    """
    phase = problem.equation.angular_frequency_per_s * seconds
    return EPS * (4.0 + phase + 0.2 * steps)


def expected_rounding(problem: Problem, seconds: float, a_radian: float = TYPICAL, power: float = 1.0) -> float:
    """Return the error over the starting amplitude that rounding is expected to leave; 0 where nothing moves.

    Parameters
    ----------
    problem : Problem
    seconds : float
    a_radian : float
        What a radian adds, over the relative rounding.
    power : float
        Of the phase with which it adds up: 1 where it repeats itself, 1/2 where it scatters.

    Notes
    -----
    The error of the phase counts by the amplitude that is left: its largest value lies where the motion has not yet
    died away. No error is told below the rounding of the displacement itself.
    """
    if problem.amplitude_m() == 0.0:
        return 0.0
    eq = problem.equation
    if eq.is_linear:
        fall = slow_rate(eq)
        rate = fall if eq.gamma_per_s >= eq.angular_frequency_per_s else eq.angular_frequency_per_s
        most = min(seconds, power / fall) if fall else seconds
        phase: float = (rate * most) ** power
        return EPS * (1.0 + a_radian * phase * math.exp(-fall * most))
    return EPS * (1.0 + a_radian * _phase_left(problem, seconds, power))


@functools.lru_cache(maxsize=16)
def _phase_left(problem: Problem, seconds: float, power: float) -> float:
    """Return the largest power of the phase times what is left of the amplitude."""
    left = Envelope.of(problem, seconds)
    return float(np.max((problem.equation.angular_frequency_per_s * left.t) ** power * left.share))


def stepped_rounding(problem: Problem, seconds: float, step_s: float) -> float:
    """Return what rounding is expected to leave of a step, s, that repeats: its coefficients' is in every one."""
    eq = problem.equation
    a_step = step_s * (eq.angular_frequency_per_s if eq.gamma_per_s < eq.angular_frequency_per_s else slow_rate(eq))
    return expected_rounding(problem, seconds, TYPICAL + A_STEP / max(a_step, EPS * EPS))


def sheared_rounding(problem: Problem, seconds: float) -> float:
    """Return what rounding of the amplitude adds to the phase under a cubic spring, as another pace.

    It scatters from step to step. Where steps begin anew at each turning point half a cycle is rounded like the next.
    """
    eq, start = problem.equation, problem.amplitude_m()
    if not eq.cubic_per_m2_s2:
        return 0.0
    left = Envelope.of(problem, seconds)
    pace, shear = pace_and_shear(eq, left.amplitude)
    radians = pace * left.t
    off = A_SHEAR_AT_TURNS * radians if eq.is_kinked else A_SHEAR * np.sqrt(radians)
    return EPS * float(np.max(np.abs(shear) * off * radians * left.amplitude)) / start
