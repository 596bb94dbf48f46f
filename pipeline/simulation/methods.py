"""Methods that do not locate turning points: explicit ones of fixed step, and scipy's DOP853.

Those of fixed step are both Euler methods, velocity Verlet, Yoshida's composition and classical Runge-Kutta. Yoshida's
weights: Phys. Lett. A 150 (1990) 262, doi:10.1016/0375-9601(90)90092-3.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from pipeline.dynamics.equation import Equation, Problem
from pipeline.dynamics.integrator import Integrator, kept
from pipeline.errors import DynamicsError, PipelineError
from pipeline.track import F8

Step = Callable[[float, float], tuple[float, float]]  # displacement and velocity before and after a step


@dataclass(frozen=True, slots=True)
class OneStep(Integrator):
    """An explicit method of fixed step without location of events.

    Parameters
    ----------
    make : callable
        Takes an equation and a step in s and returns the function of one step, which takes displacement and velocity
        before the step and returns those after it.
    closed_limit : callable, optional
        Takes angular frequency and damping rate in 1/s and returns the largest stable step in s.
    """

    make: Callable[[Equation, float], Step] = field(repr=False)
    closed_limit: Callable[[float, float], float] | None = field(default=None, repr=False)

    def stable_step(self, problem: Problem) -> float:
        """Return the largest step in s at which no motion grows, from small ones up to the starting amplitude."""
        if self.closed_limit is None:
            return math.inf
        eq, start = problem.equation, problem.amplitude_m()
        omega, gamma = eq.angular_frequency_per_s, eq.gamma_per_s
        # The stiffest case: drag at the maximum speed and the spring at the maximum displacement.
        hard = math.sqrt(omega**2 + 3.0 * max(eq.cubic_per_m2_s2, 0.0) * start**2)
        fast = gamma + eq.drag_per_m * hard * start
        return min(self.closed_limit(*pair) for pair in ((omega, gamma), (hard, gamma), (hard, fast)))

    def no_estimate(self, problem: Problem) -> str:
        """Return, with friction, that the order drops because the method does not locate turning points; else empty."""
        if not problem.equation.friction_m_per_s2:
            return ""
        return f"with friction, as the order of {self.name} drops at turning points that it does not locate"

    def march(self, problem: Problem, step_s: float, steps: int, every: int) -> tuple[F8, F8]:
        """Solve by repeating the step."""
        step = self.make(problem.equation, step_s)

        def states(y: float, v: float) -> Iterator[float]:
            while True:
                for _ in range(every):
                    y, v = step(y, v)
                yield y
                yield v

        return kept(problem, states(problem.displacement_m, problem.velocity_m_per_s), steps // every)


def _euler(eq: Equation, h: float, *, symplectic: bool) -> Step:
    a = acceleration(eq)

    def step(y: float, v: float) -> tuple[float, float]:
        after = v + h * a(y, v)
        return y + h * (after if symplectic else v), after

    return step


def _rk4(eq: Equation, h: float) -> Step:
    a = acceleration(eq)
    half, sixth = 0.5 * h, h / 6.0

    def step(y: float, v: float) -> tuple[float, float]:
        a1 = a(y, v)
        v2 = v + half * a1
        a2 = a(y + half * v, v2)
        v3 = v + half * a2
        a3 = a(y + half * v2, v3)
        v4 = v + h * a3
        a4 = a(y + h * v3, v4)
        return y + sixth * (v + 2.0 * (v2 + v3) + v4), v + sixth * (a1 + 2.0 * (a2 + a3) + a4)

    return step


def _composed(eq: Equation, h: float, weights: tuple[float, ...] = (1.0,)) -> Step:
    """Compose symmetric steps of some lengths: half the drag by its exact flow, a Verlet step, half the drag."""
    stiffness, cubic, friction = eq.angular_frequency_per_s**2, eq.cubic_per_m2_s2, eq.friction_m_per_s2
    parts = []
    for half in (0.5 * weight * h for weight in weights):
        # The flow of the drag is v s / (1 + r |v|); viscous drag shortens the time in which quadratic drag acts.
        gone = -math.expm1(-2.0 * eq.gamma_per_s * half)
        acts = gone / (2.0 * eq.gamma_per_s) if eq.gamma_per_s else half
        parts.append((half, 1.0 - gone, eq.drag_per_m * acts))

    def step(y: float, v: float) -> tuple[float, float]:
        # Friction keeps one direction per step, because Yoshida's parts go forward, backward and forward in time.
        rub = friction if v > 0 else -friction if v < 0 else 0.0
        for half, shrink, reach in parts:
            v = v * shrink / (1.0 + reach * abs(v))
            v -= half * ((stiffness + cubic * y * y) * y + rub)
            y += 2.0 * half * v
            v -= half * ((stiffness + cubic * y * y) * y + rub)
            v = v * shrink / (1.0 + reach * abs(v))
        return y, v

    return step


def acceleration(eq: Equation) -> Callable[[float, float], float]:
    """Return the acceleration in m/s^2 as a function of displacement and velocity.

    Parameters
    ----------
    eq : Equation

    Returns
    -------
    callable
        Takes y in m and v in m/s.
    """
    return eq.acceleration


def _forward_euler_limit(omega: float, gamma: float) -> float:
    # The eigenvalues 1 + h lambda stay in the unit circle up to h = -2 Re(lambda) / |lambda|^2.
    if gamma < omega:
        return 2.0 * gamma / omega**2
    return 2.0 / (gamma + math.sqrt((gamma - omega) * (gamma + omega)))


def _symplectic_euler_limit(omega: float, gamma: float) -> float:
    # Both roots of the step's characteristic polynomial stay in the unit circle if (omega h)^2 + 4 gamma h < 4.
    return 2.0 / (gamma + math.hypot(gamma, omega))


FORWARD_EULER = OneStep("forward-euler", "forward Euler", 1, partial(_euler, symplectic=False), _forward_euler_limit)
SYMPLECTIC_EULER = OneStep(
    "symplectic-euler", "symplectic Euler", 1, partial(_euler, symplectic=True), _symplectic_euler_limit
)
VERLET = OneStep("verlet", "velocity Verlet", 2, _composed, lambda omega, _: 2.0 / omega)
_OUTER = (2.0 - math.cbrt(2.0)) ** -1.0
_YOSHIDA = partial(_composed, weights=(_OUTER, 1.0 - 2.0 * _OUTER, _OUTER))
YOSHIDA4 = OneStep("yoshida4", "Yoshida's fourth-order composition", 4, _YOSHIDA)
RK4 = OneStep("rk4", "classical Runge-Kutta", 4, _rk4)


MOST_CALLS = 3_000_000  # maximum number of evaluations of the right-hand side; measured: about ten seconds
LEAST_RTOL = 3e-14  # scipy raises values below 100 times the machine epsilon: https://docs.scipy.org, RK45


@dataclass(frozen=True, slots=True)
class SolveIvp(Integrator):
    """DOP853; the errors of all its steps, each within rtol of the amplitude, accumulate."""

    name: str = "dop853"
    words: str = "scipy's solve_ivp, DOP853"
    order: int = 0
    rtol: float = 1e-9

    def refusal(self, problem: Problem) -> str:
        """Return the reason for refusal if there is friction; empty otherwise."""
        if problem.equation.friction_m_per_s2:
            return "it does not locate the turning points at which friction may hold the bob"
        return ""

    def march(self, problem: Problem, step_s: float, steps: int, every: int) -> tuple[F8, F8]:
        """Solve at every kept time, and raise an error if that takes too long."""
        from scipy.integrate import solve_ivp

        omega, size = problem.equation.angular_frequency_per_s, problem.amplitude_m() or 1.0
        pull, calls = acceleration(problem.equation), itertools.count()

        def right_side(t: float, state: F8) -> tuple[float, float]:
            if next(calls) > MOST_CALLS:
                raise DynamicsError(f"{self.name} gave up at t = {t:g} s: too stiff or too long", "take strang or auto")
            y, v = float(state[0]), float(state[1])
            return v, pull(y, v)

        t: F8 = step_s * every * np.arange(steps // every + 1, dtype=np.float64)
        start, tolerance = (problem.displacement_m, problem.velocity_m_per_s), self.rtol * size * np.array([1.0, omega])
        try:
            done = solve_ivp(
                right_side, (0.0, float(t[-1])), start, method="DOP853", t_eval=t, rtol=self.rtol, atol=tolerance
            )
        except PipelineError:
            raise
        except ValueError as error:  # raised by scipy on overflow
            raise DynamicsError(f"{self.name} gave up: {error}", "take strang or auto") from error
        if done.status < 0:
            raise DynamicsError(f"{self.name} gave up: {done.message}", "take strang or auto")
        return done.y[0], done.y[1]


DOP853 = SolveIvp()
