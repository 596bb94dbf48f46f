"""Selection of the terms of the equation that a tolerance requires: the rule of the effects table for simulations."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pipeline.dynamics.equation import Equation
from pipeline.dynamics.problem import Problem

__all__ = ["SHARE", "Term", "required"]

SHARE = 0.1  # maximum error from all omitted terms together, as a share of the tolerance

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
        Maximum change of the displacement that its omission could cause, relative to the starting amplitude.
    included : bool
        Whether the solved equation includes the term.
    why : str
        The reason for the decision in one sentence.
    in_scene : bool
        Whether the scene includes the term.
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
        Duration of the solution, s.
    tolerance : float
        Maximum error relative to the starting amplitude.

    Notes
    -----
    With :math:`\\dot A = -(\\mu + \\gamma A + \\beta A^2)` the omission of a term changes the displacement, relative to
    the starting amplitude, by at most :math:`\\gamma T + \\gamma^2 T/2\\omega`, :math:`\\beta A_0 T`,
    :math:`\\mu T/A_0` and, through the phase, :math:`3|c|A_0^2T/8\\omega`. Variations within a cycle add about one
    radian to the time T. With a cubic term the other bounds are multiplied by the phase drift that an error of the
    amplitude causes.

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
    """Return the maximum change of the displacement from omitting each term, relative to the starting amplitude."""
    eq, start = problem.equation, problem.amplitude_m()
    gamma, beta, mu = eq.laws()
    omega, cubic = eq.angular_frequency_per_s, abs(eq.cubic_per_m2_s2)
    time, drift = seconds + 1.0 / omega, 1.0
    found = {}
    if cubic:
        # With a cubic spring an error of the amplitude changes the frequency, so that a phase error accumulates.
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
    """Return the names of the terms to be kept."""
    room, left_out, kept = SHARE * tolerance, 0.0, set()
    # In order of increasing size, terms are omitted as long as their sum remains within the limit. Friction is treated
    # like the other terms, although it eventually stops every bob.
    for size, name in sorted((size if size >= 0.0 else math.inf, name) for name, size in sizes.items()):
        if left_out + size <= room:
            left_out += size
        else:
            kept.add(name)  # also terms whose size is infinite or NaN
    return kept


def _why(acts: bool, kept: bool, size: float, tolerance: float) -> str:
    if not acts:
        return "the scene has none"
    text = f"up to {min(size, 1.0):.1g} of the amplitude"
    if kept:
        return f"it changes the motion by {text}, more than its share of the tolerance {tolerance:g}"
    return f"it changes the motion by {text}, less than its share of the tolerance {tolerance:g}"
