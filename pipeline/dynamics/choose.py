"""The cheapest integrator and step that keep a tolerance."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace

from pipeline.dynamics.amplitude import stopping_time
from pipeline.dynamics.equation import Equation
from pipeline.dynamics.integrator import Integrator, Trajectory, demand_times
from pipeline.dynamics.integrators.averaged import AVERAGED
from pipeline.dynamics.integrators.exact import EXACT
from pipeline.dynamics.integrators.runge_kutta import RK4
from pipeline.dynamics.integrators.solve_ivp import SolveIvp
from pipeline.dynamics.integrators.strang import STRANG
from pipeline.dynamics.integrators.taylor import TAYLOR, Taylor
from pipeline.dynamics.prediction.pilot import fine_step, in_own_units
from pipeline.dynamics.prediction.rounding import rounding_error
from pipeline.dynamics.prediction.stretch import predicted
from pipeline.dynamics.problem import Problem
from pipeline.dynamics.terms import Term, required
from pipeline.errors import DynamicsError

__all__ = ["AUTO", "Choice", "choose", "cost_ns", "fit_step", "least_tolerance"]

AUTO: tuple[Integrator, ...] = (EXACT, AVERAGED, STRANG, TAYLOR, RK4)
"""What is chosen from."""

KNOWN: tuple[Integrator, ...] = (EXACT, TAYLOR)
"""Those of them whose error is known without a pilot."""

MOST_PARTS = 100_000
MOST_TRIES = 12
SAFETY = 1.25  # what a prediction may be short of the truth
SAFETY_UNLOCATED = 1.5  # where turning points lie within steps

# Nanoseconds on the machine of the notes: of a run, of a step and of a kept state where that is what counts.
_RUN_NS = 1e5
_STEP_NS = {
    "forward-euler": 500.0,
    "symplectic-euler": 550.0,
    "verlet": 850.0,
    "yoshida4": 1900.0,
    "rk4": 1400.0,
    "strang": 210.0,
}
_STATE_NS = {"exact": 6.0, "averaged": 90.0}
_AVERAGED_NS = 3e5
_LIMIT_NS = 2e6  # a limit of stability searched for
_TURN_NS = 1.3e4  # a turning point located by Strang


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
        Largest error of the displacement over the starting amplitude, with what the terms left out may change.
    cost_ns : float
        Of the run, as :func:`cost_ns` has it.
    problem : Problem
        What is solved: the terms that the tolerance requires.
    terms : tuple of Term
    predicted_velocity_error : float
        Largest error of the velocity over the starting amplitude times the angular frequency.
    """

    integrator: Integrator
    parts: int
    step_s: float
    predicted_error: float
    cost_ns: float
    problem: Problem
    terms: tuple[Term, ...] = ()
    predicted_velocity_error: float = math.inf

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
    spacing_s : float
        Time from one kept state to the next, s.
    count : int
        Number of spacings.
    tolerance : float
        Largest error of the displacement over the starting amplitude.

    Raises
    ------
    DynamicsError
        If the tolerance is below what double precision can reach, or no integrator keeps it.

    Examples
    --------
    >>> from pipeline.dynamics.equation import Equation
    >>> mixed = Problem(Equation.from_laws(8.66, gamma_per_s=0.0073, beta_per_m_s=0.235), 0.05)
    >>> choose(mixed, 0.01, 12000, 1e-5).integrator.name
    'strang'
    >>> choose(mixed, 0.01, 12000, 1e-11).integrator.name
    'taylor'
    """
    seconds = spacing_s * count
    demand_times(spacing_s, seconds)
    demand_tolerance(problem, seconds, tolerance)
    reduced, terms = required(problem, seconds, tolerance)
    left_out = sum(term.size for term in terms if not term.included)
    room = tolerance - left_out
    best: Choice | None = None
    # First those whose error is known without a pilot, then by what each costs at least: the dear need no prediction.
    least = {each: cost_ns(each, reduced, 1, count, seconds) for each in AUTO}
    for integrator in sorted(AUTO, key=lambda each: (each not in KNOWN, least[each])):
        most = math.inf if best is None else best.cost_ns
        if integrator not in KNOWN and least[integrator] >= most:
            continue
        safety = SAFETY_UNLOCATED if integrator is RK4 else SAFETY
        if integrator is RK4 and not _may_pay(reduced, spacing_s, count, room / safety, most):
            continue
        best = fit_step(integrator, reduced, spacing_s, count, room / safety, most) or best
    if best is None:
        raise DynamicsError(
            f"no integrator keeps a tolerance of {tolerance:g} for {seconds:g} s of this scene; "
            "ask for a larger tolerance or a shorter run"
        )
    error = best.predicted_error
    if isinstance(best.integrator, Taylor):  # so far by its tolerance
        error = best.integrator.predicted_error(reduced, best.step_s, seconds)
    return replace(
        best,
        terms=terms,
        predicted_error=error + left_out,
        predicted_velocity_error=best.integrator.predicted_velocity_error(reduced, best.step_s, seconds) + left_out,
    )


def _may_pay(problem: Problem, spacing_s: float, count: int, tolerance: float, most_ns: float) -> bool:
    """Whether Runge-Kutta, which friction keeps from its order, may cost less, as the first of its pilots has it."""
    seconds = spacing_s * count
    if problem.equation.is_linear or problem.equation.friction_m_per_s2 or not math.isfinite(most_ns):
        return False
    if _LIMIT_NS + _STEP_NS["rk4"] * seconds / fine_step(in_own_units(problem)) >= most_ns:
        return False  # the pilot alone costs more
    parts = math.floor((most_ns - _RUN_NS) / (_STEP_NS["rk4"] * count))
    return parts > 0 and predicted(RK4, STRANG, problem, spacing_s / parts, seconds, pilots=1) <= tolerance


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


def fit_step(
    integrator: Integrator,
    problem: Problem,
    spacing_s: float,
    count: int,
    tolerance: float,
    most_ns: float = math.inf,
) -> Choice | None:
    """Return an integrator with the largest step that is predicted to keep a tolerance; None where none does.

    The step divides the spacing of the kept states. What costs more than ``most_ns`` is not looked at.
    """
    seconds = spacing_s * count
    demand_times(spacing_s, seconds)
    if integrator.refusal(problem):
        return None
    if isinstance(integrator, Taylor | SolveIvp):
        integrator = replace(integrator, tolerance=min(tolerance, 1e-3))
    if cost_ns(integrator, problem, 1, count, seconds) >= most_ns or integrator.least_error(problem) > tolerance:
        return None
    parts = least = _least_parts(integrator, problem, spacing_s)
    found, tried = None, set[int]()
    for _ in range(MOST_TRIES):
        cost = cost_ns(integrator, problem, parts, count, seconds)
        if parts > MOST_PARTS or cost >= (most_ns if found is None else found.cost_ns):
            break
        error = integrator.bound(problem, spacing_s / parts, seconds)
        tried.add(parts)
        if error <= tolerance:
            found = Choice(integrator, parts, spacing_s / parts, error, cost, problem)
        if not integrator.order:
            break
        # The power law leads near. A resonance may make it lead too far at first: then it leads back.
        ratio = (error / tolerance) ** (1.0 / integrator.order) if 0.0 < error < math.inf else 4.0 if error else 0.5
        parts = max(least, math.ceil(parts * min(ratio, 100.0)))
        while parts in tried:
            parts += 1
    return found


def _least_parts(integrator: Integrator, problem: Problem, spacing_s: float) -> int:
    """Return the fewest steps a spacing with which a method is stable; more than can be where none is."""
    limit = integrator.stable_step(problem)
    if limit <= 0.0:
        return 1 if integrator.name == "forward-euler" else MOST_PARTS + 1
    return max(1, math.ceil(min(spacing_s / limit, MOST_PARTS + 1.0)))


@functools.lru_cache(maxsize=32)
def cost_ns(integrator: Integrator, problem: Problem, parts: int, count: int, seconds: float) -> float:
    """Return what a run of one trajectory costs, ns, on the machine that the figures were taken on.

    Only ratios matter; ``python benchmarks/dynamics.py`` compares them with measured times.
    """
    demand_times(seconds, seconds)
    problem = in_own_units(problem)
    eq = problem.equation
    name, cubic, friction = integrator.name, bool(eq.cubic_per_m2_s2), bool(eq.friction_m_per_s2)
    if name in _STATE_NS:
        return _RUN_NS + _AVERAGED_NS * (name == "averaged") + _STATE_NS[name] * count
    # Once friction holds the bob nothing more is solved by those who see it.
    moving = min(seconds, stopping_time(problem.amplitude_m(), *eq.laws())) if friction else seconds
    radians = float(eq.angular_frequency_per_s * moving)
    if isinstance(integrator, Taylor):
        a_radian = _taylor_ns(eq, integrator.order_of(problem, seconds))
        return _RUN_NS + radians * a_radian + 100.0 * count * moving / seconds
    if isinstance(integrator, SolveIvp):
        return float(3e5 * radians * (integrator.rtol(problem, seconds) / 1e-9) ** -0.1)
    steps = parts * count
    if name != "strang":
        return _RUN_NS + _STEP_NS[name] * steps
    if not friction:
        return _RUN_NS + (_STEP_NS[name] + 40.0 * cubic) * steps
    finer: int = max(1, math.ceil(eq.angular_frequency_per_s * seconds / steps))
    return _RUN_NS + (280.0 + 120.0 * cubic) * finer * steps * moving / seconds + radians / math.pi * _TURN_NS


def _taylor_ns(eq: Equation, order: int) -> float:
    """What a radian costs by a series of some order, as measured for orders of 12 to 21."""
    kinked, cubic = eq.drag_per_m > 0 or eq.friction_m_per_s2 > 0, eq.cubic_per_m2_s2 != 0.0
    steps: float = 1.0 + 0.03 * max(order - 12, 0) if kinked or cubic else 0.75
    return float(steps * (2e4 + 1200.0 * order + 1300.0 * order * cubic))
