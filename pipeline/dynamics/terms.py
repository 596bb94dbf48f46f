"""Which terms of the equation a tolerance requires: the rule of the effects table, for a simulation."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pipeline.dynamics.equation import Equation
from pipeline.dynamics.problem import Problem

__all__ = ["SHARE", "Term", "required"]

SHARE = 0.1  # of the tolerance, for all terms left out together

_COEFFICIENTS = {
    "viscous_drag": "gamma_per_s",
    "quadratic_drag": "drag_per_m",
    "friction": "friction_m_per_s2",
    "amplitude_dependent_frequency": "cubic_per_m2_s2",
}


@dataclass(frozen=True, slots=True)
class Term:
    """One force of the equation of motion.

    Parameters
    ----------
    name : str
    size : float
        The most that leaving it out could change the displacement, over the starting amplitude.
    included : bool
        Whether the equation that is solved holds it.
    why : str
        One sentence.
    in_scene : bool
        Whether the scene has it at all.
    """

    name: str
    size: float
    included: bool
    why: str
    in_scene: bool = True


def required(problem: Problem, seconds: float, tolerance: float) -> tuple[Problem, tuple[Term, ...]]:
    """Return the problem without the terms that the tolerance does not require, and the decision on each term.

    Parameters
    ----------
    problem : Problem
    seconds : float
        How long it is to be solved.
    tolerance : float
        Largest error over the starting amplitude.

    Notes
    -----
    With :math:`\\dot A = -(\\mu + \\gamma A + \\beta A^2)`, leaving a term out changes the displacement over the
    starting amplitude by at most :math:`\\gamma T + \\gamma^2 T/2\\omega`, :math:`\\beta A_0 T`, :math:`\\mu T/A_0`
    and, through the phase, :math:`3|c|A_0^2T/8\\omega`, and within a cycle by about a radian's worth more.

    Examples
    --------
    >>> from pipeline.dynamics.equation import Equation
    >>> equation = Equation.from_laws(8.66, gamma_per_s=0.01, beta_per_m_s=1e-9)
    >>> reduced, terms = required(Problem(equation, 0.05), 120.0, 1e-6)
    >>> reduced.equation.is_linear, [term.name for term in terms if term.included]
    (True, ['viscous_drag'])
    """
    sizes = _sizes(problem, seconds)
    kept = _kept(sizes, tolerance)
    terms = []
    for name in _COEFFICIENTS:
        size = min(sizes.get(name, 0.0), 1.0)
        why = _why(name in sizes, name in kept, size, tolerance)
        terms.append(Term(name, size, name in kept, why, name in sizes))
    if len(kept) == len(sizes):
        return problem, tuple(terms)
    eq = problem.equation
    equation = Equation(
        angular_frequency_per_s=eq.angular_frequency_per_s,
        **{each: getattr(eq, each) for name, each in _COEFFICIENTS.items() if name in kept},
    )
    return Problem(equation, problem.displacement_m, problem.velocity_m_per_s), tuple(terms)


def _sizes(problem: Problem, seconds: float) -> dict[str, float]:
    """What leaving out each term that acts could change the displacement by, over the starting amplitude."""
    eq, start = problem.equation, problem.amplitude_m()
    gamma, beta, mu = eq.laws()
    omega, cubic = eq.angular_frequency_per_s, abs(eq.cubic_per_m2_s2)
    time, drift = seconds + 1.0 / omega, 1.0
    found = {}
    if cubic:
        # Under a cubic spring another amplitude is another pace, and the phase drifts for all the time that is left.
        bend = 0.75 * cubic * (start / omega) * (start / omega)
        drift += bend / math.sqrt(1.0 + bend) * omega * time if bend < math.inf else 1e100
        found["amplitude_dependent_frequency"] = 0.375 * cubic * start * start / omega * time
    if gamma:
        found["viscous_drag"] = gamma * time * (1.0 + 0.5 * gamma / omega) * drift
    if eq.drag_per_m:
        found["quadratic_drag"] = beta * start * time * drift
    if eq.friction_m_per_s2:
        found["friction"] = mu * time / start * drift if start > 0.0 else 0.0
    return found


def _kept(sizes: dict[str, float], tolerance: float) -> set[str]:
    """Return the terms that are kept."""
    room, left_out, kept = SHARE * tolerance, 0.0, set()
    # Least first: what fits into the room together stays out. Friction always holds a bob in the end.
    for size, name in sorted((size if size >= 0.0 else math.inf, name) for name, size in sizes.items()):
        if left_out + size <= room:
            left_out += size
        else:
            kept.add(name)  # with what is beyond numbers
    return kept


def _why(acts: bool, kept: bool, size: float, tolerance: float) -> str:
    if not acts:
        return "the scene has none"
    text = f"up to {min(size, 1.0):.1g} of the amplitude"
    if kept:
        return f"it changes the motion by {text}, more than its share of the tolerance {tolerance:g}"
    return f"it changes the motion by {text}, less than its share of the tolerance {tolerance:g}"
