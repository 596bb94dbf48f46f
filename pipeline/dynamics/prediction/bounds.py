"""The most that a method errs where damping and the cubic term are moderate: in closed form, in microseconds.

A short run is over before a pilot has shown its error. What a step is then chosen by was fitted to lie above all of the
errors of 24,000 random motions of 6 to 2,000 radians, and lies within 2.3 times the error of half of them; of 340 more
it lay above those of up to 100,000 radians too, and of 12 of up to a million. A run that is long enough is chosen by
its pilot.
"""

from __future__ import annotations

import math

from pipeline.dynamics.prediction.leading import SHORT_STEP, is_weak, small_numbers
from pipeline.dynamics.prediction.pilot import resonance
from pipeline.dynamics.prediction.rounding import rounding_error
from pipeline.dynamics.problem import Problem

__all__ = ["averaged_bound", "strang_bound"]

# Up to which the bounds were fitted: gamma / omega, b A, f / (omega^2 A), |c| A^2 / omega^2; radians a step and a run.
MOST = (3.0, 1.0, 0.5, 0.2)
LONGEST_STEP, LONGEST = 1.0, 1e6
TURNS = 5e-15  # what a radian adds where turning points are located, each to so many digits
DETUNED = 15.0  # radians: in fewer no kicks get out of step
KICKS = 0.012  # the most that a resonance of drag adds in a radian, for steps of one


def strang_bound(problem: Problem, step_s: float, seconds: float) -> float:
    """Return more than the largest error of Strang splitting over the starting amplitude; inf where none was fitted.

    Notes
    -----
    The error of a cycle goes as the square of the step with drag and cubic term. What adds up is of second order in
    them, and where turning points are located of the fourth in the step.
    """
    omega = problem.equation.angular_frequency_per_s
    x, end = omega * step_s, omega * seconds
    numbers = small_numbers(problem)
    _, q, f, s = numbers
    lasting, left = _lasting(numbers, end)
    rounding = rounding_error(problem, seconds, seconds / step_s) + (TURNS * lasting if f else 0.0)
    if not (q or s):
        return rounding  # between turning points its flow is exact
    if not _fitted(numbers, end) or (x > LONGEST_STEP and not f):
        return math.inf
    if f:
        x /= max(1.0, math.ceil(x))  # no step is longer than a radian there
        drifts = (0.115 + 0.12 * s) * s * s + (0.017 * q + 0.004 * s) * x * x
        return rounding + x * x * (_within(problem, numbers, x) + drifts * lasting * left)
    if x < SHORT_STEP and is_weak(numbers):  # corrected to first order
        error = x * x * ((0.15 * q + 0.03 * s) * x * x + (0.05 * q * q + 0.09 * s * s) * lasting * left)
    else:
        error = x * x * (_within(problem, numbers, x) + (0.115 + 0.12 * s) * s * s * lasting * left)
    kicks = KICKS * x * x * x * q * lasting * math.sqrt(left)
    if kicks > error and lasting > DETUNED:
        kicks = min(kicks, resonance(problem, step_s, seconds))
    return rounding + error + kicks


def _within(problem: Problem, numbers: tuple[float, float, float, float], x: float) -> float:
    """What a cycle errs by: drag at the highest speed, the cubic term at the greatest reach."""
    g, q, _, s = numbers
    push = _push(problem)
    damped = 1.0 / (1.0 + 2.0 * g)
    speed, pushed = push + (1.0 - push) * damped, push * damped
    return (0.08 + 0.025 * x) * (q * speed * speed + s * (1.0 - push * push + pushed * pushed))


def averaged_bound(problem: Problem, seconds: float) -> float:
    """Return more than the largest error of the averaged model over the starting amplitude; inf where none was fitted.

    It lacks the cycle's harmonics, and what is of second order in damping and cubic term adds up.
    """
    end = problem.equation.angular_frequency_per_s * seconds
    numbers = small_numbers(problem)
    g, q, f, s = numbers
    if not _fitted(numbers, end):
        return math.inf
    lasting, left, push = *_lasting(numbers, end), _push(problem)
    fallen = lasting * _fall(numbers)
    harmonic = abs(3.0 - 4.0 * push * push) * push  # the start's own part in the third one
    within = 0.1 * q + (0.055 + 0.08 * harmonic) * s
    drifts = ((0.09 + 0.22 * s) * s + 0.2 * g) * s * lasting * left + 0.17 * g * (q + s) * fallen
    held = f * (0.2 + 0.17 * max(0.0, 1.0 - 2.0 * push) + 0.85 * fallen)  # in the end anywhere within friction's reach
    return rounding_error(problem, seconds) + within + drifts + held


def _fitted(numbers: tuple[float, float, float, float], end: float) -> bool:
    return end <= LONGEST and all(number <= most for number, most in zip(numbers, MOST, strict=True))


def _push(problem: Problem) -> float:
    """Return the share of the amplitude that the start has as velocity."""
    start = problem.amplitude_m()
    return abs(problem.velocity_m_per_s) / problem.equation.angular_frequency_per_s / start if start > 0.0 else 0.0


def _fall(numbers: tuple[float, float, float, float]) -> float:
    """Return what a radian takes of the amplitude at first."""
    g, q, f, _ = numbers
    return g + 0.42 * q + 0.64 * f


def _lasting(numbers: tuple[float, float, float, float], end: float) -> tuple[float, float]:
    """Return for how many radians errors add up, until the motion has fallen, and what is left of its energy then."""
    fall = _fall(numbers)
    lasting = end if fall * end < 1.0 else 1.0 / fall
    return lasting, (1.0 + fall * lasting) ** -2
