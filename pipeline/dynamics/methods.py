"""Explicit methods of fixed step: both Euler methods, velocity Verlet, Yoshida's composition, classical Runge-Kutta.

They repeat one step and do not locate turning points.

References
----------
.. [1] H. Yoshida, Phys. Lett. A 150 (1990) 262, doi:10.1016/0375-9601(90)90092-3.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from pipeline.dynamics.equation import Equation, Real
from pipeline.dynamics.integrator import Integrator, Step, StepMaker, kept, with_start
from pipeline.dynamics.problem import Problem
from pipeline.dynamics.stability import forward_euler_limit, limit_by_search, symplectic_euler_limit
from pipeline.track import F8

__all__ = ["FORWARD_EULER", "RK4", "SYMPLECTIC_EULER", "VERLET", "YOSHIDA4", "OneStep", "acceleration"]

_OUTER = 1.0 / (2.0 - 2.0 ** (1.0 / 3.0))
_WEIGHTS = (_OUTER, 1.0 - 2.0 * _OUTER, _OUTER)


@dataclass(frozen=True, slots=True)
class OneStep(Integrator):
    """An explicit method of fixed step without location of events.

    Parameters
    ----------
    make : callable
        Takes an equation and a step in s and returns the function of one step. With an array of steps (n,) the
        function makes one step of each length.
    closed_limit : callable, optional
        Takes angular frequency and damping rate in 1/s and returns the largest stable step in s. Without it the limit
        is determined by search.
    """

    make: StepMaker = field(repr=False)
    closed_limit: Callable[[float, float], float] | None = field(default=None, repr=False)

    def stable_step(self, problem: Problem) -> float:
        """Return the largest step in s at which no motion grows, from small ones up to the starting amplitude."""
        eq = problem.equation
        start = problem.amplitude_m()
        # The stiffest case: drag at the maximum speed and the spring at the maximum displacement.
        stiffer = 3.0 * eq.cubic_per_m2_s2 * start * start if eq.cubic_per_m2_s2 > 0 else 0.0
        hard = math.sqrt(eq.angular_frequency_per_s**2 + stiffer)
        fast = eq.gamma_per_s + eq.drag_per_m * hard * start
        pairs = {(eq.angular_frequency_per_s, eq.gamma_per_s), (hard, eq.gamma_per_s), (hard, fast)}
        if not (math.isfinite(hard) and math.isfinite(fast)) or fast > 1e12 * hard:
            return 0.0
        if self.closed_limit is not None:
            return min(self.closed_limit(omega, gamma) for omega, gamma in pairs)
        return float(min(limit_by_search(self.make, gamma / omega) / omega for omega, gamma in pairs))

    def no_estimate(self, problem: Problem) -> str:
        """Return, with friction, that the order drops because the method does not locate turning points; else empty."""
        if not problem.equation.friction_m_per_s2:
            return ""
        return (
            f"no error estimate with friction: the order of {self.name} drops at turning points that it does not locate"
        )

    def march(self, problem: Problem, step_s: float, steps: int, every: int) -> tuple[F8, F8]:
        """Solve by repeating the step."""
        step = self.make(problem.equation, step_s)

        def states(y: float, v: float) -> Iterator[float]:
            while True:
                y, v = step(y, v)
                yield y
                yield v

        y, v = kept(states(problem.displacement_m, problem.velocity_m_per_s), steps, every).T
        return with_start(problem, y, v)


def _forward(eq: Equation, h: float) -> Step:
    a = acceleration(eq)

    def step(y: Real, v: Real) -> tuple[Real, Real]:
        return y + h * v, v + h * a(y, v)

    return step


def _symplectic(eq: Equation, h: float) -> Step:
    a = acceleration(eq)

    def step(y: Real, v: Real) -> tuple[Real, Real]:
        v = v + h * a(y, v)
        return y + h * v, v

    return step


def _verlet(eq: Equation, h: float) -> Step:
    a = acceleration(eq)

    def step(y: Real, v: Real) -> tuple[Real, Real]:
        # Drag depends on the unknown new velocity; the second kick uses the velocity that the first one predicts.
        before = a(y, v)
        y = y + h * (v + 0.5 * h * before)
        return y, v + 0.5 * h * (before + a(y, v + h * before))

    return step


def _yoshida(eq: Equation, h: float) -> Step:
    parts = [_symmetric(eq, weight * h) for weight in _WEIGHTS]

    friction = eq.friction_m_per_s2

    def step(y: Real, v: Real) -> tuple[Real, Real]:
        # Friction keeps one direction per step, because the parts of a step go forward, backward and forward in time.
        way = (v > 0) - (v < 0) if friction else 0
        for part in parts:
            y, v = part(y, v, way)
        return y, v

    return step


def _symmetric(eq: Equation, h: float) -> Callable[[Real, Real, Real], tuple[Real, Real]]:
    """Return a time-symmetric step: half the drag by its exact flow, a Verlet step of the spring, half the drag."""
    gamma, drag, friction = eq.gamma_per_s, eq.drag_per_m, eq.friction_m_per_s2
    stiffness, cubic = eq.angular_frequency_per_s**2, eq.cubic_per_m2_s2
    shrink = np.exp(-gamma * h)
    # Quadratic drag times its effective time, which is shorter because viscous drag reduces the speed meanwhile.
    reach = drag * (-np.expm1(-gamma * h) / (2.0 * gamma) if gamma else 0.5 * h)
    if np.ndim(shrink) == 0:
        shrink, reach = float(shrink), float(reach)
    half = 0.5 * h

    def step(y: Real, v: Real, way: Real) -> tuple[Real, Real]:
        v = v * shrink / (1.0 + reach * abs(v))
        v = v - half * ((stiffness + cubic * y * y) * y + friction * way)
        y = y + h * v
        v = v - half * ((stiffness + cubic * y * y) * y + friction * way)
        return y, v * shrink / (1.0 + reach * abs(v))

    return step


def _rk4(eq: Equation, h: float) -> Step:
    a = acceleration(eq)
    half, sixth = 0.5 * h, h / 6.0

    def step(y: Real, v: Real) -> tuple[Real, Real]:
        a1 = a(y, v)
        v2 = v + half * a1
        a2 = a(y + half * v, v2)
        v3 = v + half * a2
        a3 = a(y + half * v2, v3)
        v4 = v + h * a3
        a4 = a(y + h * v3, v4)
        return y + sixth * (v + 2.0 * (v2 + v3) + v4), v + sixth * (a1 + 2.0 * (a2 + a3) + a4)

    return step


def acceleration(eq: Equation) -> Callable[[Real, Real], Real]:
    """Return the acceleration in m/s^2 as a function of displacement and velocity, without terms that are zero."""
    stiffness, cubic, force = eq.angular_frequency_per_s**2, eq.cubic_per_m2_s2, _drag_force(eq)
    if cubic:
        return lambda y, v: -(stiffness + cubic * y * y) * y - force(v)
    return lambda y, v: -stiffness * y - force(v)


def _drag_force(eq: Equation) -> Callable[[Real], Real]:
    """Return drag and friction per mass in m/s^2 as a function of velocity."""
    viscous, drag, friction = 2.0 * eq.gamma_per_s, eq.drag_per_m, eq.friction_m_per_s2
    if friction:
        return lambda v: (viscous + drag * abs(v)) * v + (friction if v > 0 else -friction if v < 0 else 0.0)
    if drag:
        return lambda v: (viscous + drag * abs(v)) * v
    return lambda v: viscous * v


FORWARD_EULER = OneStep("forward-euler", "forward Euler", 1, _forward, forward_euler_limit)
SYMPLECTIC_EULER = OneStep("symplectic-euler", "symplectic Euler", 1, _symplectic, symplectic_euler_limit)
VERLET = OneStep("verlet", "velocity Verlet", 2, _verlet)
YOSHIDA4 = OneStep("yoshida4", "Yoshida's fourth-order composition", 4, _yoshida)
RK4 = OneStep("rk4", "classical Runge-Kutta", 4, _rk4)
