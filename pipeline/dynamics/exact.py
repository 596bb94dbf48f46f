"""The exact propagator: the analytic solution of a linear scene.

It is implemented here because no library evaluates it. scipy.signal.lfilter computes the equivalent recurrence in the
same time, but its rounding errors accumulate from sample to sample.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.dynamics.flow import flows
from pipeline.dynamics.integrator import Integrator
from pipeline.dynamics.problem import Problem
from pipeline.track import F8

__all__ = ["EXACT", "Exact"]

BLOCK = 128  # states per block: the first from the closed form, each other state from the first by one matrix


@dataclass(frozen=True, slots=True)
class Exact(Integrator):
    """Integrator that evaluates the linear oscillator's analytic solution at each time."""

    name: str = "exact"
    words: str = "the exact propagator"
    order: int = 0

    def refusal(self, problem: Problem) -> str:
        """Return the reason for refusal if any force other than spring and viscous drag acts; empty otherwise."""
        if problem.equation.is_linear:
            return ""
        return "it knows spring and viscous drag only, this scene has more; take strang or auto"

    def march(self, problem: Problem, step_s: float, steps: int, every: int) -> tuple[F8, F8]:
        """Evaluate the solution at every kept time; extremely large rates give the state of rest."""
        return _states(problem, step_s * every, steps // every + 1)


EXACT = Exact()


def _states(problem: Problem, apart: float, count: int) -> tuple[F8, F8]:
    """Return displacements and velocities at multiples of the time ``apart``.

    This takes half the time of the closed form at each state, and the same time as scipy's lfilter.
    """
    blocks = -(-count // BLOCK)
    # A single call computes the first states of all blocks and the matrices within a block.
    times = apart * np.concatenate([np.arange(0.0, blocks * BLOCK, BLOCK), np.arange(float(BLOCK))])
    a, b, c, d = flows(problem.equation.angular_frequency_per_s, problem.equation.gamma_per_s, times)
    y = a[:blocks] * problem.displacement_m + b[:blocks] * problem.velocity_m_per_s
    v = c[:blocks] * problem.displacement_m + d[:blocks] * problem.velocity_m_per_s
    starts = np.array([y, v]).T
    return (
        (starts @ np.array([a[blocks:], b[blocks:]])).ravel()[:count],
        (starts @ np.array([c[blocks:], d[blocks:]])).ravel()[:count],
    )
