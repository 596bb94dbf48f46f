"""Methods that repeat one step: what they share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from pipeline.dynamics.equation import Equation, Problem, Real
from pipeline.dynamics.integrator import Step, Trajectory, every_member, integrate, march_steps, worst_error
from pipeline.dynamics.predict import predicted_by_average
from pipeline.dynamics.stability import limit_by_search

__all__ = ["OneStep", "acceleration", "drag_force"]


@dataclass(frozen=True, slots=True)
class OneStep:
    """An explicit method of fixed step without location of events.

    Parameters
    ----------
    name, words, order
        As in :class:`pipeline.dynamics.integrator.Integrator`.
    make : callable
        Equation and step, s, to the function of one step; of many steps, (n,) float64, it is a step of each.
    closed_limit : callable, optional
        Frequency, 1/s, and damping, 1/s, to the largest stable step, s; without it the limit is searched for.
    """

    name: str
    words: str
    order: int
    make: Callable[[Equation, Real], Step] = field(repr=False)
    closed_limit: Callable[[float, float], float] | None = field(default=None, repr=False)

    def refusal(self, problem: Problem) -> str:  # noqa: ARG002 - every integrator has the same signature
        """Return nothing: it takes every problem, well or badly."""
        return ""

    def run(self, problem: Problem, step_s: float, steps: int, *, every: int = 1) -> Trajectory:
        """Repeat the step; see :class:`Integrator`."""
        march = march_steps(lambda scaled, h: self.make(scaled.equation, h))
        return integrate(self, problem, step_s, steps, every, march)

    def stable_step(self, problem: Problem) -> float:
        """Return the largest step at which neither a small nor the starting motion grows, s."""
        return every_member(problem, self._limit, min)

    def predicted_error(self, problem: Problem, step_s: float, seconds: float) -> float:
        """Return the error of phase and damping that the step makes, and what friction adds; see Notes of predict."""
        return worst_error(problem, step_s, seconds, lambda one: predicted_by_average(self, one, step_s, seconds))

    def _limit(self, problem: Problem) -> float:
        eq = problem.equation
        start = problem.amplitude_m()
        # As stiff as it gets: drag at the greatest speed, the spring at the greatest reach.
        stiffer = 3.0 * eq.cubic_per_m2_s2 * start * start if eq.cubic_per_m2_s2 > 0 else 0.0
        hard = float(np.sqrt(eq.angular_frequency_per_s**2 + stiffer))
        fast = eq.gamma_per_s + eq.drag_per_m * hard * start
        pairs = {(eq.angular_frequency_per_s, eq.gamma_per_s), (hard, eq.gamma_per_s), (hard, fast)}
        if not (np.isfinite(hard) and np.isfinite(fast)) or fast > 1e12 * hard:
            return 0.0
        if self.closed_limit is not None:
            return min(self.closed_limit(omega, gamma) for omega, gamma in pairs)
        return float(min(limit_by_search(self, gamma / omega) / omega for omega, gamma in pairs))


def drag_force(eq: Equation) -> Callable[[Real], Real]:
    """Return drag and friction per mass as a function of velocity, m/s^2; terms that are 0 are left out."""
    viscous, drag, friction = 2.0 * eq.gamma_per_s, eq.drag_per_m, eq.friction_m_per_s2
    with_drag = bool(np.any(drag))
    if eq.has_friction:
        if np.ndim(friction):
            return lambda v: (viscous + drag * abs(v)) * v + friction * np.sign(v)
        return lambda v: (viscous + drag * abs(v)) * v + (friction if v > 0 else -friction if v < 0 else 0.0)
    if with_drag:
        return lambda v: (viscous + drag * abs(v)) * v
    return lambda v: viscous * v


def acceleration(eq: Equation) -> Callable[[Real, Real], Real]:
    """Return the acceleration as a function of displacement and velocity, m/s^2."""
    stiffness, cubic, force = eq.angular_frequency_per_s**2, eq.cubic_per_m2_s2, drag_force(eq)
    if np.any(cubic):
        return lambda y, v: -(stiffness + cubic * y * y) * y - force(v)
    return lambda y, v: -stiffness * y - force(v)
