"""The leading terms of an error where damping and the cubic term are weak: in closed form, without a pilot.

Strang splitting solves, to the second order of its step, an equation that differs by commutators of its parts. Their
mean over a cycle turns and shrinks the motion at rates that are products of two of the small numbers
:math:`g = \\gamma/\\omega`, :math:`q = bA`, :math:`s = cA^2/\\omega^2`; what has no mean stays what it is in one cycle,
and of that the first order is corrected. The averaged model differs from the motion in the same way, uncorrected. The
numbers below were fitted to errors, Strang's of 150 equations and the other's of 120
(``tests/unit/pipeline/dynamics/test_prediction.py`` holds them to the error itself).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from pipeline.dynamics.problem import Problem

__all__ = [
    "AVERAGED_TERMS",
    "SHORT_STEP",
    "STRANG_TERMS",
    "Terms",
    "has_leading_terms",
    "is_weak",
    "leading",
    "small_numbers",
]

WEAK = 0.03  # of each small number, up to which their products tell
SHORT_STEP = 0.5  # radians up to which the leading term of Strang's error tells
SHORTEST, LONGEST = 12.0, 1e9  # radians of a run
POINTS = 14
MARGIN = 1.15


@dataclass(frozen=True, slots=True)
class Terms:
    """Of one method, for a step of one radian where it has a step.

    Parameters
    ----------
    of_amplitude : tuple of float
        What a radian adds to the relative error of amplitude, over g s and q s.
    of_phase : tuple of float
        What it adds to that of the phase, over g q, q^2 and s^2.
    within : tuple of float
        The error within a cycle from a start at rest, over q and s, and the same from a start with a push.
    power_within : int
        Of the step with which the latter falls.
    """

    of_amplitude: tuple[float, float]
    of_phase: tuple[float, float, float]
    within: tuple[tuple[float, float], tuple[float, float]]
    power_within: int = 2


STRANG_TERMS = Terms((0.0, 0.013), (0.0, 0.036, 0.075), ((0.0, 0.013), (0.0, 0.013)), 4)
AVERAGED_TERMS = Terms((-0.2664, -0.0059), (0.1275, -0.0107, 0.072), ((0.1, 0.12), (0.12, 0.2)))


def is_weak(numbers: tuple[float, float, float, float]) -> bool:
    """Whether viscous drag, quadratic drag and the cubic term change little within a cycle."""
    g, q, _, s = numbers
    return g <= WEAK and q <= WEAK and s <= WEAK


def small_numbers(problem: Problem) -> tuple[float, float, float, float]:
    """Return g, q, friction over the spring's pull at the starting amplitude, and the size of s."""
    eq, start = problem.equation, problem.amplitude_m()
    omega = eq.angular_frequency_per_s
    reach = start / omega
    held = eq.friction_m_per_s2 / omega / omega / start if start > 0.0 else 0.0
    return eq.gamma_per_s / omega, eq.drag_per_m * start, held, abs(eq.cubic_per_m2_s2) * reach * reach


def has_leading_terms(problem: Problem, seconds: float) -> bool:
    """Whether the error of a run is known in closed form."""
    weak = is_weak(small_numbers(problem)) and not problem.equation.friction_m_per_s2
    return weak and SHORTEST < problem.equation.angular_frequency_per_s * seconds < LONGEST


def leading(
    terms: Terms, problem: Problem, radians_a_step: float, seconds: float, *, of_velocity: bool
) -> float | None:
    """Return the expected largest error over the starting amplitude; None where it takes a pilot to tell.

    Parameters
    ----------
    terms : Terms
    problem : Problem
        With its own amplitude as the unit.
    radians_a_step : float
        1 for a method without steps.
    seconds : float
    of_velocity : bool
        Of the velocity, over the amplitude times the angular frequency.
    """
    eq, start = problem.equation, problem.amplitude_m()
    omega = eq.angular_frequency_per_s
    if not has_leading_terms(problem, seconds):
        return None
    g, q, _, s = small_numbers(problem)
    s, end = math.copysign(s, eq.cubic_per_m2_s2), omega * seconds
    fall = eq.laws()[1] * start / omega
    time = 1.0 / max(g + fall, 1e-12)
    long = math.log1p(end / time)
    push = min(1.0, 3.0 * (problem.velocity_m_per_s / omega / start) ** 2)
    of_drag, of_spring = (a + (b - a) * push for a, b in zip(*terms.within, strict=True))
    once = radians_a_step ** (terms.power_within - 2) * (1.4 if of_velocity else 1.0)
    of_drag, of_spring = of_drag * once * q, of_spring * once * abs(s)
    off = phase = before = 0.0
    worst = of_drag + of_spring
    share = 1.0  # of the amplitude, at the time before
    for k in range(1, POINTS + 1):
        at = time * math.expm1(long * k / POINTS)
        now = math.exp(-g * at) / (1.0 + fall * (-math.expm1(-g * at) / g if g * at > 1e-9 else at))
        step, a = at - before, math.sqrt(share * now)
        grows = (terms.of_amplitude[0] * g * s + terms.of_amplitude[1] * q * s * a) * a * a
        drifts = terms.of_phase[0] * g * q * a + terms.of_phase[1] * (q * a) ** 2 + terms.of_phase[2] * (s * a * a) ** 2
        off += step * (grows - fall * a * off)
        phase += step * (drifts + 0.75 * s * a * a * off)
        worst = max(worst, now * (math.hypot(off, phase) + of_drag * now + of_spring * now * now))
        before, share = at, now
    return MARGIN * radians_a_step**2 * worst
