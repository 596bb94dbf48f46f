"""The method DOP853 of scipy's solve_ivp, with the interface of the other integrators."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from pipeline.dynamics.integrator import Integrator
from pipeline.dynamics.methods import acceleration
from pipeline.dynamics.problem import Problem
from pipeline.errors import DynamicsError, PipelineError
from pipeline.track import F8

MOST_CALLS = 3_000_000  # maximum number of evaluations of the right-hand side, about ten seconds
LEAST_RTOL = 3e-14  # minimum tolerance; scipy raises smaller values to a hundred times the machine epsilon


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
            return "it does not locate the turning points at which friction may hold the bob; take strang or auto"
        return ""

    def march(self, problem: Problem, step_s: float, steps: int, every: int) -> tuple[F8, F8]:
        """Solve at every kept time, and raise an error if that takes too long."""
        from scipy.integrate import solve_ivp

        omega, size = problem.equation.angular_frequency_per_s, problem.amplitude_m() or 1.0
        pull, calls = acceleration(problem.equation), itertools.count()

        def right_side(t: float, state: F8) -> tuple[float, float]:
            if next(calls) > MOST_CALLS:
                raise DynamicsError(f"{self.name} gave up at t = {t:g} s: too stiff or too long; take strang or auto")
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
            raise DynamicsError(f"{self.name} gave up: {error}; take strang or auto") from error
        if done.status < 0:
            raise DynamicsError(f"{self.name} gave up: {done.message}; take strang or auto")
        return done.y[0], done.y[1]


DOP853 = SolveIvp()
