"""The cheapest integrator and step that keep a tolerance."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from pipeline.dynamics.averaged import AVERAGED
from pipeline.dynamics.equation import Problem
from pipeline.dynamics.exact import EXACT, rounding_error
from pipeline.dynamics.integrator import Integrator, Trajectory
from pipeline.dynamics.runge_kutta import RK4
from pipeline.dynamics.solve_ivp import SolveIvp
from pipeline.dynamics.strang import STRANG
from pipeline.dynamics.taylor import TAYLOR, Taylor
from pipeline.dynamics.terms import SHARE, Term, required
from pipeline.errors import DynamicsError

__all__ = ["AUTO", "Choice", "choose", "cost_ns", "fit_step", "least_tolerance"]

AUTO: tuple[Integrator, ...] = (EXACT, AVERAGED, STRANG, RK4, TAYLOR)
"""What is chosen from. Every other method costs more than one of these at any tolerance; ``trade`` shows it."""

MOST_PARTS = 100_000
MOST_TRIES = 12
SAFETY = 1.2  # what a prediction may be short of the truth

# Nanoseconds on the machine of the notes: of a step, and of a kept state where that is what counts.
_STEP_NS = {
    "forward-euler": 500.0,
    "symplectic-euler": 550.0,
    "verlet": 900.0,
    "yoshida4": 1900.0,
    "rk4": 1200.0,
    "strang": 200.0,
}
_STATE_NS = {"exact": 6.0, "averaged": 130.0}


@dataclass(frozen=True, slots=True)
class Choice:
    """An integrator with its step.

    Parameters
    ----------
    integrator : Integrator
    parts : int
        Steps from one kept state to the next.
    step_s : float
        s.
    predicted_error : float
        Largest error of the displacement over the starting amplitude.
    cost_ns : float
        Of the run, as :func:`cost_ns` has it.
    problem : Problem
        What is solved: the terms that the tolerance requires.
    terms : tuple of Term
    """

    integrator: Integrator
    parts: int
    step_s: float
    predicted_error: float
    cost_ns: float
    problem: Problem
    terms: tuple[Term, ...] = ()

    def run(self, count: int) -> Trajectory:
        """Solve the problem for so many spacings."""
        return self.integrator.run(self.problem, self.step_s, count * self.parts, every=self.parts)


def least_tolerance(problem: Problem, seconds: float) -> float:
    """Return the least tolerance that can be kept: twice the rounding of the phase, or 1e-13.

    Examples
    --------
    >>> from pipeline.dynamics.equation import Equation
    >>> least_tolerance(Problem(Equation(angular_frequency_per_s=8.66), 0.05), 120.0) < 1e-12
    True
    """
    return max(1e-13, 2.0 * rounding_error(problem, seconds))


def choose(problem: Problem, spacing_s: float, count: int, tolerance: float) -> Choice:
    """Return the cheapest choice that keeps a tolerance.

    Parameters
    ----------
    problem : Problem
        Of one trajectory.
    spacing_s : float
        Time from one kept state to the next, s.
    count : int
        Number of spacings.
    tolerance : float
        Largest error of the displacement over the starting amplitude.

    Raises
    ------
    DynamicsError
        If the tolerance is below what double precision can reach.

    Examples
    --------
    >>> from pipeline.dynamics.equation import Equation
    >>> mixed = Problem(Equation.from_laws(8.66, gamma_per_s=0.0073, beta_per_m_s=0.235), 0.05)
    >>> choose(mixed, 0.01, 12000, 1e-5).integrator.name
    'strang'
    >>> choose(mixed, 0.01, 12000, 1e-11).integrator.name
    'taylor'
    """
    demand_tolerance(problem, spacing_s * count, tolerance)
    reduced, terms = required(problem, spacing_s * count, tolerance)
    options = []
    for integrator in AUTO:
        found = fit_step(integrator, reduced, spacing_s, count, (1.0 - SHARE) * tolerance / SAFETY)
        if found is not None:
            options.append(replace(found, terms=terms))
            if integrator is EXACT:
                break  # nothing is cheaper
    if not options:
        raise DynamicsError(
            f"no integrator keeps a tolerance of {tolerance:g} for {spacing_s * count:g} s of this scene; "
            "ask for a larger tolerance or a shorter run"
        )
    return min(options, key=lambda choice: choice.cost_ns)


def demand_tolerance(problem: Problem, seconds: float, tolerance: float) -> None:
    """Refuse a tolerance that no integrator could keep.

    Raises
    ------
    DynamicsError
    """
    least = least_tolerance(problem, seconds)
    if not (math.isfinite(tolerance) and tolerance >= least):
        raise DynamicsError(
            f"the tolerance must be finite and at least {least:.1e}, what double precision can reach in {seconds:g} s, "
            f"got {tolerance:g}"
        )


def fit_step(integrator: Integrator, problem: Problem, spacing_s: float, count: int, tolerance: float) -> Choice | None:
    """Return an integrator with the largest step that is predicted to keep a tolerance; None where none does.

    The step divides the spacing of the kept states.
    """
    if integrator.refusal(problem):
        return None
    seconds = spacing_s * count
    if isinstance(integrator, Taylor | SolveIvp):
        integrator = replace(integrator, tolerance=min(tolerance, 1e-3))
    parts = 1
    if math.isfinite(limit := integrator.stable_step(problem)):
        if limit <= 0.0 and integrator.name != "forward-euler":
            return None
        parts = max(1, math.ceil(spacing_s / limit)) if limit > 0.0 else 1
    found, too_few = None, 0
    for _ in range(MOST_TRIES):
        if parts > MOST_PARTS:
            break
        error = integrator.predicted_error(problem, spacing_s / parts, seconds)
        if error <= tolerance:
            cost = cost_ns(integrator, problem, parts, count, seconds)
            found = Choice(integrator, parts, spacing_s / parts, error, cost, problem)
        else:
            too_few = parts
        if not integrator.order or (found is not None and found.parts <= too_few + 1):
            break
        # The power law leads near; what is known to be too few or enough bounds it.
        ratio = (error / tolerance) ** (1.0 / integrator.order) if 0.0 < error < math.inf else 4.0 if error else 0.5
        parts = max(too_few + 1, math.ceil(parts * min(ratio, 100.0)))
        if found is not None and parts >= found.parts:
            break
    return found


def cost_ns(integrator: Integrator, problem: Problem, parts: int, count: int, seconds: float) -> float:
    """Return what a run of one trajectory costs, ns, on the machine that the figures were taken on.

    Only ratios matter; ``springmass trade --integrators`` measures them on any machine.
    """
    eq = problem.equation
    radians = eq.angular_frequency_per_s * seconds
    if integrator.name in _STATE_NS:
        return 1e5 + _STATE_NS[integrator.name] * count
    if isinstance(integrator, Taylor):
        kinked = eq.drag_per_m > 0 or eq.friction_m_per_s2 > 0
        steps = radians * (0.65 if kinked else 0.62)
        return float(1e5 + steps * (6e4 + 6e4 * bool(eq.cubic_per_m2_s2)) + 100.0 * count)
    if isinstance(integrator, SolveIvp):
        return float(3e5 * radians * (integrator.rtol(problem, seconds) / 1e-9) ** -0.1)
    step = _STEP_NS[integrator.name]
    turns = 0.0
    if integrator.name == "strang":
        step += 150.0 * bool(eq.cubic_per_m2_s2) + 200.0 * bool(eq.friction_m_per_s2)
        turns = radians / math.pi * 1.5e4 if eq.friction_m_per_s2 else 0.0
    return float(1e5 + step * parts * count + turns)
