"""The methods LSODA and DOP853 of scipy's solve_ivp, with the interface of the other integrators."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.dynamics.equation import Equation
from pipeline.dynamics.integrator import Integrator
from pipeline.dynamics.problem import Problem
from pipeline.errors import DynamicsError
from pipeline.track import F8

__all__ = ["DOP853", "LEAST_RTOL", "LSODA", "SolveIvp"]

MOST_CALLS = 3_000_000  # maximum number of evaluations of the right-hand side, about ten seconds
LEAST_RTOL = 3e-14  # minimum tolerance; scipy raises smaller values to a hundred times the machine epsilon


@dataclass(frozen=True, slots=True)
class SolveIvp(Integrator):
    """One method of solve_ivp.

    Parameters
    ----------
    method : str
        Name of the method in solve_ivp.
    rtol : float
        Tolerance of one step relative to the amplitude; the errors of all steps accumulate.
    """

    method: str
    rtol: float = 1e-9

    def march(self, problem: Problem, step_s: float, steps: int, every: int) -> tuple[F8, F8]:
        """Solve at every kept time, and raise an error if that takes too long."""
        t: F8 = step_s * every * np.arange(steps // every + 1, dtype=np.float64)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # solve_ivp also reports such failures in its result
            try:
                y, v = self._solve(problem, t)
            except (ValueError, np.linalg.LinAlgError) as error:  # raised by scipy on overflow
                raise DynamicsError(f"{self.name} gave up: {error}; take strang or auto") from error
        return y, v

    def _solve(self, problem: Problem, t: F8) -> F8:
        """Return displacement and velocity (2, n); with friction, integrate from turning point to turning point."""
        from scipy.integrate import solve_ivp

        eq, calls = problem.equation, itertools.count()
        start = np.array([problem.displacement_m, problem.velocity_m_per_s])
        size = max(problem.amplitude_m(), np.finfo(np.float64).tiny)
        options: dict[str, Any] = {
            "method": self.method,
            "rtol": self.rtol,
            "atol": self.rtol * np.array([size, size * eq.angular_frequency_per_s]),
        }
        if not eq.friction_m_per_s2:
            done = solve_ivp(self._right_side(eq, 0, calls), (0.0, float(t[-1])), start, t_eval=t, **options)
            return np.asarray(self._whole(done).y)
        states = np.empty((2, t.size))
        row, now = 0, 0.0
        while row < t.size:
            way = eq.direction(*start)
            if way == 0:
                states[:, row:] = start[:, None]
                break
            done = self._whole(
                solve_ivp(
                    self._right_side(eq, way, calls),
                    (now, float(t[-1])),
                    start,
                    events=_turning(way),
                    dense_output=True,
                    **options,
                )
            )
            turned = done.status == 1
            end = float(done.t_events[0][0]) if turned else float(t[-1])
            last = int(np.searchsorted(t, end, side="right"))
            if last > row:
                states[:, row:last] = done.sol(t[row:last])
            row, now = last, end
            start = np.array([done.sol(end)[0], 0.0])
            if not turned:
                break
        return states

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

    def _whole(self, done: Any) -> Any:
        if done.status < 0:
            raise DynamicsError(f"{self.name} gave up: {done.message}; take strang or auto")
        return done


def _turning(way: int) -> Callable[[float, F8], float]:
    def turning(t: float, state: F8) -> float:  # noqa: ARG001
        return float(state[1])

    turning.terminal = True  # type: ignore[attr-defined]
    turning.direction = -way  # type: ignore[attr-defined]
    return turning


LSODA = SolveIvp("lsoda", "scipy's solve_ivp, LSODA", 0, "LSODA")
DOP853 = SolveIvp("dop853", "scipy's solve_ivp, DOP853", 0, "DOP853")
