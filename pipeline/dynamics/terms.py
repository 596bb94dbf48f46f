"""Which terms of the equation a tolerance requires: the rule of the effects table, for a simulation."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pipeline.dynamics.problem import Problem

__all__ = ["SHARE", "Term", "required"]

SHARE = 0.1  # of the tolerance, for all terms left out together


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
    """

    name: str
    size: float
    included: bool
    why: str


def required(problem: Problem, seconds: float, tolerance: float) -> tuple[Problem, tuple[Term, ...]]:
    """Return the problem without the terms that the tolerance does not require, and what became of each.

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
    eq, start = problem.equation, problem.amplitude_m()
    gamma, beta, mu = eq.laws()
    omega = eq.angular_frequency_per_s
    time = seconds + 1.0 / omega
    with np.errstate(over="ignore"):
        # Under a cubic spring another amplitude is another pace, and the phase drifts for all the time that is left.
        bend = 0.75 * abs(eq.cubic_per_m2_s2) * (start / omega) * (start / omega)
        drift = 1.0 + bend / math.sqrt(1.0 + bend) * omega * time if math.isfinite(bend) else 1e100
        sizes = {
            "viscous_drag": ("gamma_per_s", gamma * time * (1.0 + 0.5 * gamma / omega) * drift),
            "quadratic_drag": ("drag_per_m", beta * start * time * drift),
            "friction": ("friction_m_per_s2", mu * time / start * drift if start > 0 else 0.0),
            "amplitude_dependent_frequency": (
                "cubic_per_m2_s2",
                0.375 * abs(eq.cubic_per_m2_s2) * start * start / omega * time,
            ),
        }
    sizes = {name: (attribute, math.inf if math.isnan(size) else size) for name, (attribute, size) in sizes.items()}
    room = SHARE * tolerance
    terms, dropped = [], {}
    for name, (attribute, size) in sorted(sizes.items(), key=lambda item: item[1][1]):
        acts = getattr(eq, attribute) != 0.0
        # Least first: what fits into the room together stays out. Friction always holds a bob in the end.
        kept = bool(acts and size > room)
        if not kept:
            room -= size
            dropped[attribute] = 0.0
        terms.append(Term(name, min(size, 1.0), kept, _why(acts, kept, size, tolerance)))
    order = list(sizes)
    return replace(problem, equation=replace(eq, **dropped)), tuple(
        sorted(terms, key=lambda term: order.index(term.name))
    )


def _why(acts: bool, kept: bool, size: float, tolerance: float) -> str:
    if not acts:
        return "the scene has none"
    told = f"up to {min(size, 1.0):.1g} of the amplitude"
    if kept:
        return f"it changes the motion by {told}, more than its share of the tolerance {tolerance:g}"
    return f"it changes the motion by {told}, less than its share of the tolerance {tolerance:g}"
