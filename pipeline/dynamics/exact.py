"""The exact propagator: a linear scene needs no approximation.

By hand, as no library evaluates it: scipy.signal.lfilter has the same recurrence in the same time, and its rounding
adds up from sample to sample.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.dynamics.flow import flows
from pipeline.dynamics.integrator import Integrator
from pipeline.dynamics.problem import Problem
from pipeline.track import F8

__all__ = ["EXACT", "Exact"]

BLOCK = 128  # states of a block from its first by one matrix each; a block's first by the closed form


@dataclass(frozen=True, slots=True)
class Exact(Integrator):
    """The linear oscillator's own solution, evaluated at each time."""

    name: str = "exact"
    words: str = "the exact propagator"
    order: int = 0

    def refusal(self, problem: Problem) -> str:
        """Return why not, where anything but spring and viscous drag acts."""
        if problem.equation.is_linear:
            return ""
        return "it knows spring and viscous drag only, this scene has more; take strang or auto"

    def march(self, problem: Problem, step_s: float, steps: int, every: int) -> tuple[F8, F8]:
        """Evaluate the solution at every kept time; rates beyond all bounds end at rest."""
        return _states(problem, step_s * every, steps // every + 1)


EXACT = Exact()


def _states(problem: Problem, apart: float, count: int) -> tuple[F8, F8]:
    """States at multiples of a time apart: half as long as the closed form at each, and as long as scipy's lfilter."""
    blocks = -(-count // BLOCK)
    # One call for the first states of all blocks and for the matrices within one.
    times = apart * np.concatenate([np.arange(0.0, blocks * BLOCK, BLOCK), np.arange(float(BLOCK))])
    a, b, c, d = flows(problem.equation.angular_frequency_per_s, problem.equation.gamma_per_s, times)
    y = a[:blocks] * problem.displacement_m + b[:blocks] * problem.velocity_m_per_s
    v = c[:blocks] * problem.displacement_m + d[:blocks] * problem.velocity_m_per_s
    starts = np.array([y, v]).T
    return (
        (starts @ np.array([a[blocks:], b[blocks:]])).ravel()[:count],
        (starts @ np.array([c[blocks:], d[blocks:]])).ravel()[:count],
    )
