"""The base class of all integrators, the trajectory that they return, and the checks common to all of them."""

from __future__ import annotations

import itertools
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from pipeline.dynamics.equation import Equation, Real
from pipeline.dynamics.problem import Problem
from pipeline.errors import DynamicsError
from pipeline.track import F8

__all__ = ["Integrator", "Step", "StepMaker", "Trajectory", "demand_times", "kept", "with_start"]

SHORTEST_S, LONGEST_S = 1e-100, 1e100
STRETCH = 1_000_000  # approximate number of states buffered before every n-th one is kept

Step = Callable[[Real, Real], tuple[Real, Real]]
"""One step: takes displacement and velocity before the step and returns those after it."""

StepMaker = Callable[[Equation, Real], Step]
"""Takes an equation and a step in s and returns the function of one step.

With an array of steps (n,) the function makes one step of each length.
"""


@dataclass(frozen=True, slots=True)
class Integrator(ABC):
    """Base class of the methods that solve the equation of motion.

    Parameters
    ----------
    name : str
        Name on the command line.
    words : str
        Name for use in a sentence.
    order : int
        Order of the method: the power of the step in the error; 0 if the step is only the spacing of kept states.
    """

    name: str
    words: str
    order: int

    def refusal(self, problem: Problem) -> str:  # noqa: ARG002 - some integrators override this
        """Return why the integrator cannot solve this problem; empty if it can solve it."""
        return ""

    def stable_step(self, problem: Problem) -> float:  # noqa: ARG002 - for some it depends on the problem
        """Return the largest step in s at which no free motion grows; inf if every step is stable, 0 if none is."""
        return math.inf

    def no_estimate(self, problem: Problem) -> str:  # noqa: ARG002 - for some it depends on the problem
        """Return why step halving cannot estimate the integrator's error; empty if it can."""
        return ""

    @abstractmethod
    def march(self, problem: Problem, step_s: float, steps: int, every: int) -> tuple[F8, F8]:
        """Return displacements and velocities (n,) at the start and after every ``every`` steps, in problem units."""

    def run(self, problem: Problem, step_s: float, steps: int, *, every: int = 1) -> Trajectory:
        """Solve a problem in units near its amplitude, with checks of the arguments and of the result.

        Parameters
        ----------
        problem : Problem
        step_s : float
            Step, s.
        steps : int
            Number of steps.
        every : int
            Number of steps from one kept state to the next; it must divide ``steps``.

        Raises
        ------
        DynamicsError
            If the step or the number of steps is invalid, the method cannot solve this problem, or the solution
            overflows.
        """
        demand_times(step_s, step_s * steps)
        if steps < 1 or every < 1 or steps % every:
            raise DynamicsError(
                f"the number of steps must be a positive multiple of {max(every, 1)}, of which one is kept, got {steps}"
            )
        why = self.refusal(problem)
        if why:
            raise DynamicsError(f"{self.name} cannot solve this: {why}")
        scaled, unit = problem.scaled()
        with np.errstate(all="ignore"):
            try:
                y, v = self.march(scaled, step_s, steps, every)
            except (OverflowError, ZeroDivisionError) as error:
                raise DynamicsError(
                    f"{self.name} ran beyond the range of numbers ({error}); {self._remedy(problem)}"
                ) from error
            y *= unit
            v *= unit
        fine = np.isfinite(y) & np.isfinite(v)
        if not fine.all():
            first = step_s * every * int(np.argmin(fine))
            raise DynamicsError(
                f"{self.name} ran beyond the range of numbers by t = {first:g} s; {self._remedy(problem)}"
            )
        return Trajectory(problem, step_s * every, y, v)

    def _remedy(self, problem: Problem) -> str:
        limit = self.stable_step(problem)
        if 0 < limit < np.inf:
            return f"take a step of at most {limit:.3g} s, or {'auto' if self.name == 'strang' else 'strang'}"
        return "take a shorter run, or strang or auto"


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """A solved motion.

    Parameters
    ----------
    problem : Problem
    spacing_s : float
        Time from one kept state to the next, s.
    y : (n,) float64, m
        Displacement from rest.
    v : (n,) float64, m/s
        Velocity.
    """

    problem: Problem
    spacing_s: float
    y: F8
    v: F8

    @property
    def t(self) -> F8:
        """Times (n,) float64, s, each as index times spacing, so that rounding errors do not accumulate."""
        return np.asarray(self.spacing_s * np.arange(len(self.y), dtype=np.float64))

    def at(self, t: F8) -> F8:
        """Return interpolated displacements (k,) at times t (k,) in s; constant before the first and after the last.

        The cubic Hermite interpolation through displacements and velocities errs by at most (omega spacing)^4 / 384 of
        the amplitude. For equal spacings it takes 0.4 of the time of scipy.interpolate.CubicHermiteSpline, which a fit
        would have to import first.

        Raises
        ------
        DynamicsError
            For a time that is not a number, or a displacement that overflows.
        """
        with np.errstate(all="ignore"):
            place = np.clip(np.asarray(t) / self.spacing_s, 0.0, len(self.y) - 1.0)
            if np.any(np.isnan(place)):
                raise DynamicsError("the times asked for must be numbers, got NaN")
            row = np.minimum(place.astype(np.intp), len(self.y) - 2)
            x = place - row
            y, v = self.y, self.v * self.spacing_s
            rise = x * x * (3.0 - 2.0 * x)
            bends = x * (1.0 - x) * ((1.0 - x) * v[row] - x * v[row + 1])
            found = np.asarray((1.0 - rise) * y[row] + rise * y[row + 1] + bends)
        if not np.all(np.isfinite(found)):
            raise DynamicsError("between its states the displacement leaves the range of numbers; take a finer spacing")
        return found

    def relative_energy(self) -> F8:
        """Return the mechanical energy (n,) relative to that at the start; 1 if the start has no energy.

        The state is scaled before it is squared, so that the result is correct for every representable amplitude.
        """
        scaled, unit = self.problem.scaled()
        with np.errstate(over="ignore", invalid="ignore"):
            now = _energy(scaled, self.y / unit, self.v / unit)
            start = _energy(scaled, np.asarray(scaled.displacement_m), np.asarray(scaled.velocity_m_per_s))
            relative = now / start if start > 0.0 else np.ones_like(now)
        if not np.all(np.isfinite(relative)):
            raise DynamicsError("the energy grew beyond the range of numbers; take fewer steps or another method")
        return relative


def _energy(problem: Problem, y: F8, v: F8) -> F8:
    eq = problem.equation
    energy = 0.5 * (v**2 + (eq.angular_frequency_per_s * y) ** 2)
    return np.asarray(energy + 0.25 * eq.cubic_per_m2_s2 * y**4 if eq.cubic_per_m2_s2 else energy)


def kept(states: Iterator[float], steps: int, every: int) -> F8:
    """Return the states (n, 2) after every ``every`` steps, from displacements and velocities in alternation."""
    stretch = every * max(1, STRETCH // every)
    parts = []
    for start in range(0, steps, stretch):
        found = np.fromiter(itertools.islice(states, 2 * min(stretch, steps - start)), np.float64).reshape(-1, 2)
        parts.append(found[every - 1 :: every].copy())
        if len(found) < stretch:
            break
    return np.concatenate(parts)


def with_start(problem: Problem, y: F8, v: F8) -> tuple[F8, F8]:
    """Return displacements and velocities (n + 1,) with the start state prepended to the given ones (n,)."""
    return np.concatenate([[problem.displacement_m], y]), np.concatenate([[problem.velocity_m_per_s], v])


def demand_times(step_s: float, seconds: float) -> None:
    """Refuse a step or a duration that is not positive or is outside the allowed range.

    Raises
    ------
    DynamicsError
        For a step or a duration outside 1e-100 to 1e100 s.
    """
    for name, value in (("step", step_s), ("duration", seconds)):
        if not SHORTEST_S <= value <= LONGEST_S:
            raise DynamicsError(f"the {name} must be between {SHORTEST_S:g} and {LONGEST_S:g} s, got {value!r}")
