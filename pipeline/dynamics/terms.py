"""Selection of the terms of the equation that a tolerance requires."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from pipeline.dynamics.problem import Problem

SHARE = 0.1  # maximum error from all omitted terms together, as a share of the tolerance
COEFFICIENTS = {
    "viscous_drag": "gamma_per_s",
    "quadratic_drag": "drag_per_m",
    "friction": "friction_m_per_s2",
    "amplitude_dependent_frequency": "cubic_per_m2_s2",
}


@dataclass(frozen=True, slots=True)
class Term:
    """One force of the equation of motion: whether it is solved, and why."""

    name: str
    size: float  # maximum change of the displacement without it, relative to the starting amplitude
    included: bool
    why: str


def required(problem: Problem, seconds: float, tolerance: float) -> tuple[Problem, tuple[Term, ...]]:
    """Return the problem without the terms that the tolerance does not require, and the decision on each term.

    In order of increasing size, terms are omitted as long as their sum stays within a tenth of the tolerance, the
    maximum error relative to the starting amplitude.

    >>> from pipeline.dynamics.equation import Equation
    >>> equation = Equation.from_laws(8.66, gamma_per_s=0.01, beta_per_m_s=1e-9)
    >>> reduced, terms = required(Problem(equation, 0.05), 120.0, 1e-6)
    >>> reduced.equation.is_linear, [term.name for term in terms if term.included]
    (True, ['viscous_drag'])
    """
    sizes = _sizes(problem, seconds)
    left_out: set[str] = set()
    for name in sorted(sizes, key=sizes.__getitem__):
        if sum(sizes[each] for each in (*left_out, name)) <= SHARE * tolerance:
            left_out.add(name)
    terms = [Term(name, 0.0, False, "the scene has none") for name in COEFFICIENTS]
    for row, name in enumerate(COEFFICIENTS):
        if name in sizes:
            size, less = min(sizes[name], 1.0), "less" if name in left_out else "more"
            why = f"up to {size:.1g} of the amplitude, {less} than its share of the tolerance {tolerance:g}"
            terms[row] = Term(name, size, name not in left_out, why)
    omitted = {COEFFICIENTS[name]: 0.0 for name in left_out}
    return replace(problem, equation=replace(problem.equation, **omitted)), tuple(terms)


def _sizes(problem: Problem, seconds: float) -> dict[str, float]:
    """Return a bound on the change of the displacement by omitting each term, relative to the starting amplitude.

    With :math:`\\dot A = -(\\mu + \\gamma A + \\beta A^2)` the bounds are :math:`\\gamma T + \\gamma^2 T/2\\omega`,
    :math:`\\beta A_0 T`, :math:`\\mu T/A_0` and, through the phase, :math:`3|c|A_0^2T/8\\omega`. Variations within a
    cycle add about one radian to the time T. With a cubic term an error of the amplitude changes the frequency, and the
    other bounds are multiplied by the phase drift that this causes.
    """
    eq, start = problem.equation, problem.amplitude_m()
    gamma, beta, mu = eq.laws()
    omega, cubic = eq.angular_frequency_per_s, abs(eq.cubic_per_m2_s2)
    time, drift = seconds + 1.0 / omega, 1.0
    found = {}
    if cubic:
        bend = 0.75 * cubic * (start / omega) ** 2
        drift += bend / math.sqrt(1.0 + bend) * omega * time
        found["amplitude_dependent_frequency"] = 0.375 * cubic * start**2 / omega * time
    if gamma:
        found["viscous_drag"] = gamma * time * (1.0 + 0.5 * gamma / omega) * drift
    if eq.drag_per_m:
        found["quadratic_drag"] = beta * start * time * drift
    if eq.friction_m_per_s2:
        found["friction"] = mu * time / start * drift if start > 0.0 else 0.0
    return found
