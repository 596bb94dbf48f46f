"""The cheapest integrator and step that keep a tolerance."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

from pipeline.dynamics.amplitude import stopping_time
from pipeline.dynamics.equation import Equation
from pipeline.dynamics.integrator import Integrator, Trajectory, demand_times
from pipeline.dynamics.integrators.averaged import AVERAGED
from pipeline.dynamics.integrators.exact import EXACT
from pipeline.dynamics.integrators.runge_kutta import RK4
from pipeline.dynamics.integrators.solve_ivp import SolveIvp
from pipeline.dynamics.integrators.strang import STRANG
from pipeline.dynamics.integrators.taylor import TAYLOR, Taylor
from pipeline.dynamics.prediction.leading import SHORT_STEP, has_leading_terms
from pipeline.dynamics.prediction.pilot import fine_step
from pipeline.dynamics.prediction.rounding import rounding_error
from pipeline.dynamics.prediction.stretch import predicted
from pipeline.dynamics.problem import Problem
from pipeline.dynamics.terms import Term, reduced, required
from pipeline.errors import DynamicsError

__all__ = ["AUTO", "Choice", "choose", "cost_ns", "fit_step", "least_tolerance"]

BOUNDED: tuple[Integrator, ...] = (EXACT, STRANG, AVERAGED, TAYLOR)
"""Those whose error has a bound in closed form, the likeliest to be taken first."""

AUTO: tuple[Integrator, ...] = (*BOUNDED, RK4)
"""What is chosen from."""

MOST_PARTS = 100_000
MOST_TRIES = 12
SAFETY = 1.25  # what a prediction may be short of the truth
SAFETY_BOUND = 1.1  # what a bound may be
SAFETY_UNLOCATED = 1.5  # where turning points lie within steps
LEAST_TERMS = 6  # of a series
PILOT_SHARE = 0.3  # of the run that is known, which a pilot may cost to find one that costs less
LIKELY = 1.5  # steps that a bound asks for over those that are needed
PILOT_RADIANS = 120.0  # of a motion that is looked at

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
_LEADING_NS = 1.5e5  # an error predicted in closed form
_LIMIT_NS = 2e6  # a limit of stability searched for
_TRY_NS = 4e4  # a step looked at
_TURN_NS = 1.3e4  # a turning point located by Strang


@dataclass(frozen=True)  # no slots: what is told when it is asked for is remembered
class Choice:
    """An integrator with its step.

    Parameters
    ----------
    integrator : Integrator
    parts : int
        Steps from one kept state to the next.
    step_s : float
        s.
    seconds : float
        How long the run is, s.
    cost_ns : float
        Of the run, as :func:`cost_ns` has it.
    problem : Problem
        What is solved: the terms that the tolerance requires.
    left_out : float
        The most that the terms left out change the displacement, over the starting amplitude.
    stated, tolerance : Problem or None, float
        All terms, and what decided which to leave out.
    """

    integrator: Integrator
    parts: int
    step_s: float
    seconds: float
    cost_ns: float
    problem: Problem
    left_out: float = 0.0
    stated: Problem | None = None
    tolerance: float = math.inf

    @functools.cached_property
    def predicted_error(self) -> float:
        """Largest error of the displacement over the starting amplitude, with what the terms left out may change.

        Worked out when it is asked for: a run may be over before its error has been predicted.
        """
        return self.integrator.predicted_error(self.problem, self.step_s, self.seconds) + self.left_out

    @functools.cached_property
    def predicted_velocity_error(self) -> float:
        """The same of the velocity, over the starting amplitude times the angular frequency."""
        return self.integrator.predicted_velocity_error(self.problem, self.step_s, self.seconds) + self.left_out

    @functools.cached_property
    def terms(self) -> tuple[Term, ...]:
        """What became of each term; of a method taken by name none."""
        return () if self.stated is None else required(self.stated, self.seconds, self.tolerance)[1]

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
    solved, left_out = reduced(problem, seconds, tolerance)
    room = tolerance - left_out
    within = room / SAFETY_BOUND
    radians = math.ceil(min(problem.equation.angular_frequency_per_s * spacing_s, MOST_PARTS))
    best: Choice | None = None
    for integrator in BOUNDED:
        most = math.inf if best is None else best.cost_ns
        best = fit_step(integrator, solved, spacing_s, count, within, most, bounded=True, first=radians) or best
        if best is not None and best.integrator is EXACT:
            break  # nothing costs less
    best = _by_pilots(best, solved, spacing_s, count, room)
    if best is None:
        raise DynamicsError(
            f"no integrator keeps a tolerance of {tolerance:g} for {seconds:g} s of this scene; "
            "ask for a larger tolerance or a shorter run"
        )
    return Choice(best.integrator, best.parts, best.step_s, seconds, best.cost_ns, solved, left_out, problem, tolerance)


def _by_pilots(best: Choice | None, problem: Problem, spacing_s: float, count: int, room: float) -> Choice | None:
    """Return what costs less by its predicted error, where predicting is little beside the run; else what there is."""
    seconds = spacing_s * count
    for integrator in (AVERAGED, STRANG, RK4):
        most = math.inf if best is None else best.cost_ns
        if PILOT_SHARE * most < _LEADING_NS:
            break
        least = cost_ns(integrator, problem, 1, count, seconds)
        if integrator.refusal(problem) or least >= most:
            continue
        first = 1
        if best is not None:
            # Where a motion dies out from one kept state to the next a bound counts errors that none of them shows.
            if best.integrator is integrator and problem.equation.gamma_per_s * spacing_s <= 1.0:
                first = max(1, round(best.parts / LIKELY))
            pilot = _pilot_ns(integrator, problem, spacing_s / first, seconds)
            # Of Strang a bound is known: no prediction makes its run much shorter.
            if pilot > PILOT_SHARE * most or least + pilot >= most or (integrator is not STRANG and pilot > least):
                continue
        most_error = room / (SAFETY_UNLOCATED if integrator is RK4 else SAFETY)
        if integrator is RK4 and not _may_pay(problem, spacing_s, count, most_error, most):
            continue
        best = fit_step(integrator, problem, spacing_s, count, most_error, most, first=first) or best
    return best


def _pilot_ns(integrator: Integrator, problem: Problem, step_s: float, seconds: float) -> float:
    """What it costs to predict an error: three runs of Strang splitting in fine steps, and a limit to be searched."""
    omega = problem.equation.angular_frequency_per_s
    known = has_leading_terms(problem, seconds)
    if known and (integrator is AVERAGED or (integrator is STRANG and omega * step_s < SHORT_STEP)):
        return _LEADING_NS
    looked = min(seconds, PILOT_RADIANS / omega)
    steps = math.ceil(min(looked / max(fine_step(problem), 1e-200), 1e9))
    return 3.0 * cost_ns(STRANG, problem, 1, steps, looked) + _LIMIT_NS * (integrator is RK4)


def _may_pay(problem: Problem, spacing_s: float, count: int, tolerance: float, most_ns: float) -> bool:
    """Whether Runge-Kutta, which friction keeps from its order, may cost less, as the first of its pilots has it."""
    if problem.equation.is_linear or problem.equation.friction_m_per_s2 or not math.isfinite(most_ns):
        return False
    parts = math.floor((most_ns - _RUN_NS) / (_STEP_NS["rk4"] * count))
    return parts > 0 and predicted(RK4, STRANG, problem, spacing_s / parts, spacing_s * count, pilots=1) <= tolerance


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
    *,
    bounded: bool = False,
    first: int = 1,
) -> Choice | None:
    """Return an integrator with the largest step that is predicted to keep a tolerance; None where none does.

    The step divides the spacing of the kept states. What costs more than ``most_ns`` is not looked at. With ``bounded``
    the error's bound has to keep the tolerance, which makes the step shorter and takes no pilot. The first step that is
    looked at is the spacing over ``first``.
    """
    seconds = spacing_s * count
    if most_ns < math.inf and _least_ns(integrator, problem, count, seconds) >= most_ns:
        return None
    if integrator.refusal(problem):
        return None
    integrator = integrator.keeping(tolerance)
    if integrator.least_error(problem) > tolerance:
        return None
    # The bound of the series is what it is asked to keep.
    error_of = integrator.bound if bounded or integrator.name == "taylor" else integrator.predicted_error
    least = _least_parts(integrator, problem, spacing_s)
    parts = max(first, least) if integrator.order else 1
    found, tried = None, set[int]()
    order, before, error_before = float(integrator.order), 0, 0.0
    for _ in range(MOST_TRIES):
        cost = cost_ns(integrator, problem, parts, count, seconds)
        if parts > MOST_PARTS or cost >= (most_ns if found is None else found.cost_ns - _TRY_NS):
            break
        error = error_of(problem, spacing_s / parts, seconds)
        tried.add(parts)
        if error <= tolerance:
            found = Choice(integrator, parts, spacing_s / parts, seconds, cost, problem)
        if not order or (parts == least and found is not None) or (bounded and error == math.inf):
            break
        told = 0.0 < error < math.inf
        if bounded and told and error_before:
            shown = math.log(error_before / error) / math.log(parts / before)
            order = min(max(shown, 1.0), 2.0 * integrator.order)
        # A power law leads near: by the order, then as two tries show it. A resonance may make it lead too far at
        # first: then it leads back.
        ratio = (error / tolerance) ** (1.0 / order) if told else 4.0 if error else 0.5
        before, error_before = parts, error if told else 0.0
        parts = max(least, math.ceil(parts * min(ratio, 100.0)))
        while parts in tried:
            parts += 1
    return found


def _least_parts(integrator: Integrator, problem: Problem, spacing_s: float) -> int:
    """Return the fewest steps a spacing with which a method is stable; more than can be where none is."""
    limit = integrator.stable_step(problem)
    if limit == math.inf:
        return 1
    if limit <= 0.0:
        return 1 if integrator.name == "forward-euler" else MOST_PARTS + 1
    return max(1, math.ceil(min(spacing_s / limit, MOST_PARTS + 1.0)))


def cost_ns(integrator: Integrator, problem: Problem, parts: int, count: int, seconds: float) -> float:
    """Return what a run of one trajectory costs, ns, on the machine that the figures were taken on.

    Only ratios matter; ``python benchmarks/dynamics.py`` compares them with measured times.
    """
    demand_times(seconds, seconds)
    eq = problem.equation
    name, cubic, friction = integrator.name, bool(eq.cubic_per_m2_s2), bool(eq.friction_m_per_s2)
    if name in _STATE_NS:
        return _RUN_NS + _AVERAGED_NS * (name == "averaged") + _STATE_NS[name] * count
    # Once friction holds the bob nothing more is solved by those who see it.
    moving = min(seconds, _held(problem)) if friction else seconds
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


def _least_ns(integrator: Integrator, problem: Problem, count: int, seconds: float) -> float:
    """Return what a run costs at the least; of a series, before the number of its terms is known."""
    if integrator.name != "taylor":
        return cost_ns(integrator, problem, 1, count, seconds)
    moving = min(seconds, _held(problem)) if problem.equation.friction_m_per_s2 else seconds
    return _RUN_NS + problem.equation.angular_frequency_per_s * moving * _taylor_ns(problem.equation, LEAST_TERMS)


def _held(problem: Problem) -> float:
    """When friction holds the bob, s: in units of the amplitude, so that nothing leaves the range of numbers."""
    start, (gamma, beta, mu) = problem.amplitude_m(), problem.equation.laws()
    return stopping_time(1.0, gamma, beta * start, min(mu / start, 1e300)) if start > 0.0 else 0.0


def _taylor_ns(eq: Equation, order: int) -> float:
    """What a radian costs by a series of some order, as measured for orders of 12 to 21."""
    kinked, cubic = eq.drag_per_m > 0 or eq.friction_m_per_s2 > 0, eq.cubic_per_m2_s2 != 0.0
    steps: float = 1.0 + 0.03 * max(order - 12, 0) if kinked or cubic else 0.75
    return float(steps * (2e4 + 1200.0 * order + 1300.0 * order * cubic))
