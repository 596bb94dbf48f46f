"""The method DOP853 of scipy's solve_ivp, with the interface of the other integrators."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.dynamics.equation import Equation
from pipeline.dynamics.integrator import Integrator
from pipeline.dynamics.problem import Problem
from pipeline.errors import DynamicsError
from pipeline.track import F8

MOST_CALLS = 3_000_000  # maximum number of evaluations of the right-hand side, about ten seconds
LEAST_RTOL = 3e-14  # minimum tolerance; scipy raises smaller values to a hundred times the machine epsilon


@dataclass(frozen=True, slots=True)
class SolveIvp(Integrator):
    """One method of solve_ivp.

    Parameters
    ----------
    rtol : float
        Tolerance of one step relative to the amplitude; the errors of all steps accumulate.
    """

    name: str = "dop853"
    words: str = "scipy's solve_ivp, DOP853"
    order: int = 0
    rtol: float = 1e-9

    def march(self, problem: Problem, step_s: float, steps: int, every: int) -> tuple[F8, F8]:
        """Solve at every kept time; with friction, from turning point to turning point."""
        from scipy.integrate import solve_ivp

        eq, calls = problem.equation, itertools.count()
        t: F8 = step_s * every * np.arange(steps // every + 1, dtype=np.float64)
        y, v, size = problem.displacement_m, problem.velocity_m_per_s, problem.amplitude_m() or 1.0
        states, row, now = np.empty((2, t.size)), 0, 0.0
        while row < t.size:
            way = eq.direction(y, v) if eq.friction_m_per_s2 else 1
            if way == 0:
                states[:, row:] = [[y], [0.0]]
                break
            try:
                done = solve_ivp(
                    self._right_side(eq, way, calls),
                    (now, float(t[-1])),
                    (y, v),
                    method="DOP853",
                    t_eval=t[row:],
                    events=_turning(way) if eq.friction_m_per_s2 else None,
                    rtol=self.rtol,
                    atol=self.rtol * np.array([size, size * eq.angular_frequency_per_s]),
                )
            except ValueError as error:  # raised by scipy on overflow
                raise DynamicsError(f"{self.name} gave up: {error}; take strang or auto") from error
            if done.status < 0:
                raise DynamicsError(f"{self.name} gave up: {done.message}; take strang or auto")
            states[:, row : row + done.t.size] = done.y
            row += done.t.size
            if done.status == 1:
                now, y, v = float(done.t_events[0][0]), float(done.y_events[0][0][0]), 0.0
        return states[0], states[1]

    def _right_side(
        self, eq: Equation, way: int, calls: itertools.count[int]
    ) -> Callable[[float, F8], tuple[float, float]]:
        stiffness, viscous, drag = eq.angular_frequency_per_s**2, 2.0 * eq.gamma_per_s, eq.drag_per_m
        friction, cubic = way * eq.friction_m_per_s2, eq.cubic_per_m2_s2

        def right_side(t: float, state: F8) -> tuple[float, float]:
            if next(calls) > MOST_CALLS:
                raise DynamicsError(f"{self.name} gave up at t = {t:g} s: too stiff or too long; take strang or auto")
            y, v = float(state[0]), float(state[1])
            return v, -(stiffness + cubic * y * y) * y - (viscous + drag * abs(v)) * v - friction

        return right_side


def _turning(way: int) -> Callable[[float, F8], float]:
    def turning(t: float, state: F8) -> float:  # noqa: ARG001
        return float(state[1])

    turning.terminal = True  # type: ignore[attr-defined]
    turning.direction = -way  # type: ignore[attr-defined]
    return turning


DOP853 = SolveIvp()
