"""Methods that repeat one step: what they share."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from pipeline.dynamics.equation import Equation, Real
from pipeline.dynamics.integrator import Integrator, StepMaker, demand_times, kept, with_start
from pipeline.dynamics.integrators.strang import STRANG
from pipeline.dynamics.prediction.pilot import bounded, in_own_units
from pipeline.dynamics.prediction.rounding import stepped_rounding
from pipeline.dynamics.prediction.stability import limit_by_search
from pipeline.dynamics.prediction.stretch import predicted
from pipeline.dynamics.problem import Problem
from pipeline.track import F8

__all__ = ["OneStep", "acceleration"]


@dataclass(frozen=True, slots=True)
class OneStep(Integrator):
    """An explicit method of fixed step without location of events.

    Parameters
    ----------
    make : callable
        Equation and step, s, to the function of one step; of many steps, (n,) float64, it is a step of each.
    closed_limit : callable, optional
        Frequency, 1/s, and damping, 1/s, to the largest stable step, s; without it the limit is searched for.
    """

    make: StepMaker = field(repr=False)
    closed_limit: Callable[[float, float], float] | None = field(default=None, repr=False)

    def stable_step(self, problem: Problem) -> float:
        """Return the largest step at which neither a small nor the starting motion grows, s."""
        eq = problem.equation
        start = problem.amplitude_m()
        # As stiff as it gets: drag at the greatest speed, the spring at the greatest reach.
        stiffer = 3.0 * eq.cubic_per_m2_s2 * start * start if eq.cubic_per_m2_s2 > 0 else 0.0
        hard = math.sqrt(eq.angular_frequency_per_s**2 + stiffer)
        fast = eq.gamma_per_s + eq.drag_per_m * hard * start
        pairs = {(eq.angular_frequency_per_s, eq.gamma_per_s), (hard, eq.gamma_per_s), (hard, fast)}
        if not (math.isfinite(hard) and math.isfinite(fast)) or fast > 1e12 * hard:
            return 0.0
        if self.closed_limit is not None:
            return min(self.closed_limit(omega, gamma) for omega, gamma in pairs)
        return float(min(limit_by_search(self.make, gamma / omega) / omega for omega, gamma in pairs))

    def predicted_error(self, problem: Problem, step_s: float, seconds: float) -> float:
        """Return what pilot runs show, and the rounding."""
        return self._predicted(problem, step_s, seconds, of_velocity=False)

    def predicted_velocity_error(self, problem: Problem, step_s: float, seconds: float) -> float:
        """Return what the same pilots show of the velocity."""
        return self._predicted(problem, step_s, seconds, of_velocity=True)

    def _predicted(self, problem: Problem, step_s: float, seconds: float, *, of_velocity: bool) -> float:
        demand_times(step_s, seconds)
        rounding = stepped_rounding(in_own_units(problem), seconds, step_s)
        of = bounded(lambda: predicted(self, STRANG, problem, step_s, seconds, of_velocity=of_velocity))
        return rounding + of

    def march(self, problem: Problem, step_s: float, steps: int, every: int) -> tuple[F8, F8]:
        """Repeat the step."""
        step = self.make(problem.equation, step_s)

        def states(y: float, v: float) -> Iterator[float]:
            while True:
                y, v = step(y, v)
                yield y
                yield v

        y, v = kept(states(problem.displacement_m, problem.velocity_m_per_s), steps, every).T
        return with_start(problem, y, v)


def acceleration(eq: Equation) -> Callable[[Real, Real], Real]:
    """Return the acceleration as a function of displacement and velocity, m/s^2; terms that are 0 are left out."""
    stiffness, cubic, force = eq.angular_frequency_per_s**2, eq.cubic_per_m2_s2, _drag_force(eq)
    if cubic:
        return lambda y, v: -(stiffness + cubic * y * y) * y - force(v)
    return lambda y, v: -stiffness * y - force(v)


def _drag_force(eq: Equation) -> Callable[[Real], Real]:
    """Drag and friction per mass as a function of velocity, m/s^2."""
    viscous, drag, friction = 2.0 * eq.gamma_per_s, eq.drag_per_m, eq.friction_m_per_s2
    if friction:
        return lambda v: (viscous + drag * abs(v)) * v + (friction if v > 0 else -friction if v < 0 else 0.0)
    if drag:
        return lambda v: (viscous + drag * abs(v)) * v
    return lambda v: viscous * v
