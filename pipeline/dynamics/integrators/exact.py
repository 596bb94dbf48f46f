"""The exact propagator: a linear scene needs no approximation."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.dynamics.equation import Problem
from pipeline.dynamics.flow import flows
from pipeline.dynamics.integrator import Trajectory, demand_run, demand_times, solved
from pipeline.track import F8

__all__ = ["EXACT", "Exact", "rounding_error"]

BLOCK = 128  # states of a block from its first by one matrix each; a block's first by the closed form


def rounding_error(problem: Problem, seconds: float, steps: float = 0.0) -> float:
    """Return the error over the amplitude that rounding leaves at best: of the phase, and of steps that repeat.

    Notes
    -----
    The phase :math:`\\omega t` is a product of rounded numbers: its error is its own size times the relative rounding.
    A step that is repeated repeats the rounding of its coefficients: a fifth of the relative rounding each.
    """
    phase = float(np.max(problem.equation.angular_frequency_per_s)) * seconds
    return float(np.finfo(np.float64).eps) * (4.0 + phase + 0.2 * steps)


@dataclass(frozen=True, slots=True)
class Exact:
    """The linear oscillator's own solution, evaluated at each time."""

    name: str = "exact"
    words: str = "the exact propagator"
    order: int = 0

    def refusal(self, problem: Problem) -> str:
        """Return why not, where anything but spring and viscous drag acts."""
        if problem.equation.is_linear:
            return ""
        return "it knows spring and viscous drag only, this scene has more; take strang, taylor or auto"

    def run(self, problem: Problem, step_s: float, steps: int, *, every: int = 1) -> Trajectory:
        """Evaluate the solution at every kept time; see :class:`Integrator`."""
        demand_run(self, problem, step_s, steps, every)
        with np.errstate(all="ignore"):  # rates beyond all bounds end at rest
            y, v = _states(problem, step_s * every, steps // every + 1)
        return solved(self, problem, step_s * every, y, v)

    def stable_step(self, problem: Problem) -> float:  # noqa: ARG002 - every integrator has the same signature
        """Return inf: it is exact for any step."""
        return math.inf

    def predicted_error(self, problem: Problem, step_s: float, seconds: float) -> float:
        """Return the rounding of the phase."""
        demand_times(step_s, seconds)
        return rounding_error(problem, seconds)


EXACT = Exact()


def _states(problem: Problem, apart: float, count: int) -> tuple[F8, F8]:
    omega, gamma = problem.equation.angular_frequency_per_s, problem.equation.gamma_per_s
    blocks = -(-count // BLOCK)
    shape = np.shape(problem.displacement_m)
    # One call for the first states of all blocks and for the matrices within one; times first, members after.
    number = np.empty((blocks + BLOCK, *(1,) * len(shape)))
    number[:blocks, ...] = np.arange(0, blocks * BLOCK, BLOCK).reshape(-1, *(1,) * len(shape))
    number[blocks:, ...] = np.arange(BLOCK).reshape(-1, *(1,) * len(shape))
    number *= apart
    a, b, c, d = flows(omega, gamma, number)
    y = a[:blocks] * problem.displacement_m + b[:blocks] * problem.velocity_m_per_s
    v = c[:blocks] * problem.displacement_m + d[:blocks] * problem.velocity_m_per_s
    a, b, c, d = (entry[blocks:] for entry in (a, b, c, d))
    if not shape:
        starts = np.array([y, v]).T
        return (starts @ np.array([a, b])).ravel()[:count], (starts @ np.array([c, d])).ravel()[:count]
    ys = a[None] * y[:, None] + b[None] * v[:, None]
    vs = c[None] * y[:, None] + d[None] * v[:, None]
    return ys.reshape(-1, *shape)[:count], vs.reshape(-1, *shape)[:count]
