"""Taylor series of any order with turning points located: the reference among the integrators.

By hand, as nothing of scipy's is as exact: over two minutes of mixed drag it errs by 1e-14 of the amplitude in 0.15 s,
DOP853 at its least tolerance by 8e-12 in 4 s.

Between turning points the equation has no kink, and its solution's Taylor coefficients follow from each other. The
step is as long as the last coefficients allow; where the velocity passes zero the series ends, the signs of drag and
friction change, and a bob that the spring pulls with less than friction holds stays where it is.

References
----------
.. [1] A. Jorba, M. Zou, Exp. Math. 14 (2005) 99, doi:10.1080/10586458.2005.10128904.
"""

from __future__ import annotations

import functools
import itertools
import math
from dataclasses import dataclass

import numpy as np

from pipeline.dynamics.amplitude import stopping_time
from pipeline.dynamics.integrator import Integrator, demand_times
from pipeline.dynamics.integrators.series import fastest, local_error, pieces, terms_of
from pipeline.dynamics.prediction.envelope import frequency
from pipeline.dynamics.prediction.left_out import Piece, left_out
from pipeline.dynamics.prediction.pilot import bounded, in_own_units
from pipeline.dynamics.prediction.rounding import rounding_error
from pipeline.dynamics.problem import Problem
from pipeline.errors import DynamicsError
from pipeline.track import F8

__all__ = ["TAYLOR", "Taylor"]

LONGEST = 1.6  # radians a step; turning points lie twice as far apart
MOST_STEPS = 200_000  # as planned
SHORT = 2  # times what is planned a run may take: a drag or spring that shortens steps makes the plan fall short


@dataclass(frozen=True, slots=True)
class Taylor(Integrator):
    """Adaptive Taylor series.

    Parameters
    ----------
    tolerance : float
        Error over the amplitude at the end of the run; the step passed to :meth:`run` is only the spacing of what is
        kept.
    longest : float
        Radians a step at most.
    """

    name: str = "taylor"
    words: str = "adaptive Taylor series with turning points located"
    order: int = 0
    tolerance: float = 1e-13
    longest: float = LONGEST

    def refusal(self, problem: Problem) -> str:
        """Return why not, where viscous drag is so stiff that the series would take a step for nothing."""
        eq = problem.equation
        if eq.gamma_per_s > 1e4 * eq.angular_frequency_per_s:
            return "viscous drag this stiff needs a step far below the motion's own time; take strang, exact or auto"
        return ""

    def keeping(self, tolerance: float) -> Taylor:
        """Return the series of that tolerance, a thousandth at most."""
        return Taylor(tolerance=min(tolerance, 1e-3), longest=self.longest)

    def bound(self, problem: Problem, step_s: float, seconds: float) -> float:
        """Return the tolerance, or the rounding where that is more; inf for more steps than it takes."""
        demand_times(step_s, seconds)
        problem, _ = problem.scaled()
        eq = problem.equation
        # Where drag outweighs the spring its own time is what a step has; at a turning point another step ends.
        stiff = math.sqrt(1.0 + eq.drag_per_m * problem.amplitude_m())
        moving = min(seconds, 1.1 * _held(problem))
        turns = moving * float(frequency(eq, np.array([problem.amplitude_m()]))[0]) / math.pi
        longest = (fastest(problem) * stiff + eq.gamma_per_s) * moving / self.longest
        if longest + (turns if eq.is_kinked else 0.0) > MOST_STEPS:
            return math.inf
        return max(self.tolerance, rounding_error(problem, seconds))

    def predicted_error(self, problem: Problem, step_s: float, seconds: float) -> float:
        """Return what the first terms left out add up to, and the rounding; inf for more steps than it takes."""
        return self._predicted(problem, step_s, seconds, of_velocity=False)

    def predicted_velocity_error(self, problem: Problem, step_s: float, seconds: float) -> float:
        """Return the same of the velocity."""
        return self._predicted(problem, step_s, seconds, of_velocity=True)

    def _predicted(self, problem: Problem, step_s: float, seconds: float, *, of_velocity: bool) -> float:
        bound = self.bound(problem, step_s, seconds)
        if math.isinf(bound) or self.refusal(problem):
            return math.inf
        return min(bound, bounded(lambda: _left_out(self, in_own_units(problem), step_s, seconds)[of_velocity]))

    def order_of(self, problem: Problem, seconds: float) -> int:
        """Return the number of terms of its series."""
        return terms_of(local_error(problem, seconds, self.tolerance), self.longest)

    def march(self, problem: Problem, step_s: float, steps: int, every: int) -> tuple[F8, F8]:
        """Solve from turning point to turning point."""
        states = _solve(problem, step_s * every, steps // every + 1, self.tolerance, self.longest)
        return states[:, 0], states[:, 1]


TAYLOR = Taylor()


@functools.lru_cache(maxsize=8)
def _left_out(method: Taylor, problem: Problem, spacing_s: float, seconds: float) -> tuple[float, float]:
    """Return the errors of displacement and velocity; remembered, as they come together."""
    local = local_error(problem, seconds, method.tolerance)
    return left_out(problem, lambda each: pieces(each, local, method.longest, spare=True), spacing_s, seconds)


def _held(problem: Problem) -> float:
    """When friction holds the bob, s; beyond critical damping it never quite does."""
    eq = problem.equation
    return stopping_time(problem.amplitude_m(), *eq.laws()) if eq.gamma_per_s < eq.angular_frequency_per_s else math.inf


def _solve(problem: Problem, apart: float, count: int, tolerance: float, longest: float) -> F8:
    """Return the states (count, 2) at multiples of a time apart."""
    states = np.empty((count, 2))
    states[0] = problem.displacement_m, problem.velocity_m_per_s
    local = local_error(problem, apart * count, tolerance)
    too_long = DynamicsError(
        f"taylor needs more than {SHORT * MOST_STEPS} steps for {apart * (count - 1):g} s; "
        "take a shorter run, strang or auto"
    )
    if fastest(problem) * min(apart * (count - 1), _held(problem)) > longest * SHORT * MOST_STEPS:
        raise too_long
    row, since = 0, 0.0  # the last state kept, and the time since: a sum of short times rounds little
    for each in itertools.islice(pieces(problem, local, longest), SHORT * MOST_STEPS):
        if each.long == math.inf:
            states[row + 1 :] = each.end
            return states
        row, since = _keep(states, row, since, apart, each)
        if row == count - 1:
            return states
    raise too_long


def _keep(states: F8, row: int, since: float, apart: float, piece: Piece) -> tuple[int, float]:
    """Fill in the states that the step passes; return the last one's row and the time since."""
    passed = min(math.floor((since + piece.long) / apart), len(states) - 1 - row)
    if passed:
        times = (apart * np.arange(1, passed + 1) - since) / piece.unit
        powers = np.vander(times, len(piece.ys), increasing=True)
        states[row + 1 : row + 1 + passed] = powers @ np.array((piece.ys, piece.vs)).T
    return row + passed, since + piece.long - passed * apart
