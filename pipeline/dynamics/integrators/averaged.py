"""The averaged amplitude model: the amplitude by its own law, the phase beside it; no step at all.

It is the motion that the analysis fits, and an approximation of the equation of motion: what drag does within a cycle
is averaged away.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.dynamics.amplitude import amplitude
from pipeline.dynamics.integrator import Integrator, demand_times
from pipeline.dynamics.integrators.strang import STRANG
from pipeline.dynamics.prediction.bounds import averaged_bound
from pipeline.dynamics.prediction.leading import AVERAGED_TERMS, leading
from pipeline.dynamics.prediction.pilot import bounded, in_own_units
from pipeline.dynamics.prediction.rounding import expected_rounding
from pipeline.dynamics.prediction.stretch import predicted
from pipeline.dynamics.problem import Problem
from pipeline.track import F8

__all__ = ["AVERAGED", "Averaged"]

MOST_TURNS = 8
PARTS, MOST_POINTS = 20.0, 4_000_000  # of a decay, where the amplitude's square is summed; of all
WEAK = 0.3  # damping rate over frequency up to which a cycle can be averaged over


@dataclass(frozen=True, slots=True)
class Averaged(Integrator):
    """The averaged amplitude model."""

    name: str = "averaged"
    words: str = "the averaged amplitude model"
    order: int = 0

    def refusal(self, problem: Problem) -> str:
        """Return why not, where a cycle changes the amplitude too much to be averaged over."""
        if _hardness(problem) > WEAK:
            return "its cosine is far from the motion where the cubic term is next to the spring; take strang or auto"
        if _weakness(problem) <= WEAK:
            return ""
        return f"a cycle can be averaged over where damping takes less than {WEAK:g} per radian; take strang or auto"

    def least_error(self, problem: Problem) -> float:
        """Return a quarter of the third harmonic that a cycle has and a cosine has not."""
        return 0.25 * max(0.1 * problem.equation.drag_per_m * problem.amplitude_m(), _hardness(problem) / 32.0)

    def bound(self, problem: Problem, step_s: float, seconds: float) -> float:  # noqa: ARG002 - it has no step
        """Return a fitted bound; see :func:`pipeline.dynamics.prediction.bounds.averaged_bound`."""
        return averaged_bound(problem, seconds)

    def predicted_error(self, problem: Problem, step_s: float, seconds: float) -> float:
        """Return what a pilot run shows."""
        return self._predicted(problem, step_s, seconds, of_velocity=False)

    def predicted_velocity_error(self, problem: Problem, step_s: float, seconds: float) -> float:
        """Return what the same pilot shows of the velocity."""
        return self._predicted(problem, step_s, seconds, of_velocity=True)

    def _predicted(self, problem: Problem, step_s: float, seconds: float, *, of_velocity: bool) -> float:
        demand_times(step_s, seconds)
        if self.refusal(problem):
            return math.inf
        rounding = expected_rounding(in_own_units(problem), seconds)
        known = leading(AVERAGED_TERMS, in_own_units(problem), 1.0, seconds, of_velocity=of_velocity)
        if known is not None:
            return rounding + known
        return rounding + bounded(lambda: predicted(self, STRANG, problem, step_s, seconds, of_velocity=of_velocity))

    def march(self, problem: Problem, step_s: float, steps: int, every: int) -> tuple[F8, F8]:
        """Evaluate the model at every kept time."""
        eq = problem.equation
        gamma, beta, mu = eq.laws()
        t: F8 = step_s * every * np.arange(steps // every + 1, dtype=np.float64)
        damped = math.sqrt((eq.angular_frequency_per_s - gamma) * (eq.angular_frequency_per_s + gamma))
        y, v = problem.displacement_m, problem.velocity_m_per_s
        # Displacement and velocity tell amplitude and phase only together with the rate at which it falls.
        start, rate = problem.amplitude_m(), gamma
        bend = 0.375 * eq.cubic_per_m2_s2 / eq.angular_frequency_per_s
        turn = damped
        for _ in range(MOST_TURNS):
            before = start
            rate = gamma + beta * start + (mu / start if start > 0.0 else 0.0)
            turn = damped + bend * start**2
            start = math.hypot(y, (v + rate * y) / turn)
            if abs(start - before) <= 1e-16 * start:
                break
        phase = math.atan2(-(v + rate * y) / turn, y)
        a = amplitude(start, gamma, beta, mu, t)
        falling = np.where(a > 0, mu + (gamma + beta * a) * a, 0.0)
        angle = phase + damped * t
        if bend:
            angle = angle + bend * _summed_squares(start, (gamma, beta, mu), t)
        cosine, sine = np.cos(angle), np.sin(angle)
        return a * cosine, -falling * cosine - a * (damped + bend * a**2) * sine


AVERAGED = Averaged()


def _weakness(problem: Problem) -> float:
    """Damping per radian at the start."""
    gamma, beta, mu = problem.equation.laws()
    start = problem.amplitude_m()
    held = mu / start if start > 0.0 else 0.0
    return float((gamma + beta * start + held) / problem.equation.angular_frequency_per_s)


def _hardness(problem: Problem) -> float:
    """The cubic term over the spring at the starting amplitude; products, as powers overflow with an error."""
    reach = problem.amplitude_m() / problem.equation.angular_frequency_per_s
    return float(abs(problem.equation.cubic_per_m2_s2) * reach * reach)


def _summed_squares(start: float, laws: tuple[float, float, float], t: F8) -> F8:
    """The integral of the amplitude's square from the first time to each, by Simpson's rule in parts of a decay."""
    gamma, beta, mu = laws
    fall = gamma + beta * start + (mu / start if start > 0.0 else 0.0)
    apart = float(t[1] - t[0])
    parts = math.ceil(min(1.0 + PARTS * fall * apart, MOST_POINTS / len(t)))
    fine = np.linspace(0.0, float(t[-1]), 2 * parts * (len(t) - 1) + 1)
    squares = amplitude(start, gamma, beta, mu, fine) ** 2
    each = (squares[:-2:2] + 4.0 * squares[1::2] + squares[2::2]) * (apart / parts / 6.0)
    return np.concatenate([[0.0], np.cumsum(each)[parts - 1 :: parts]])
