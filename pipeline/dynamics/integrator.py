"""What every integrator is, what it returns, and what all of them demand."""

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
STRETCH = 1_000_000  # states held until those asked for are taken from them

Step = Callable[[Real, Real], tuple[Real, Real]]
"""One step: displacement and velocity before it to those after it."""

StepMaker = Callable[[Equation, Real], Step]
"""Equation and step, s, to the function of one step; of many steps, (n,) float64, it is a step of each."""


@dataclass(frozen=True, slots=True)
class Integrator(ABC):
    """A way to solve the equation of motion.

    Parameters
    ----------
    name : str
        What the command line takes.
    words : str
        Its name in a sentence.
    order : int
        Power of the step with which the error falls; 0 where the step is only the spacing of what is kept.
    """

    name: str
    words: str
    order: int

    def refusal(self, problem: Problem) -> str:  # noqa: ARG002 - some integrators override this
        """Return why the integrator cannot solve this problem; empty if it can."""
        return ""

    def stable_step(self, problem: Problem) -> float:  # noqa: ARG002 - for some it depends on the problem
        """Return the largest step that does not make a free motion grow, s; inf for any, 0 for none."""
        return math.inf

    def no_estimate(self, problem: Problem) -> str:  # noqa: ARG002 - for some it depends on the problem
        """Return why step halving shows nothing of its error; empty where it does."""
        return ""

    @abstractmethod
    def march(self, problem: Problem, step_s: float, steps: int, every: int) -> tuple[F8, F8]:
        """Return displacements and velocities (n,) in units of the amplitude, once per ``every`` steps."""

    def run(self, problem: Problem, step_s: float, steps: int, *, every: int = 1) -> Trajectory:
        """Solve a problem: check what is asked, march in units of the amplitude, check what came.

        Parameters
        ----------
        problem : Problem
        step_s : float
            Step, s.
        steps : int
            Number of steps.
        every : int
            Keep the state after each so many steps; divides ``steps``.

        Raises
        ------
        DynamicsError
            If step or number of steps cannot be, the method cannot solve this problem, or the numbers ran away.
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
        """Times (n,) float64, s: each the product of its number and the spacing, so that nothing accumulates."""
        return np.asarray(self.spacing_s * np.arange(len(self.y), dtype=np.float64))

    def at(self, t: F8) -> F8:
        """Return displacements (k,) at times between, (k,) in s; held before and after.

        A cubic through displacements and velocities: it errs by at most (omega spacing)^4 / 384 of the amplitude. On
        equal spacings in 0.4 of the time of scipy.interpolate.CubicHermiteSpline, which a fit would import first.

        Raises
        ------
        DynamicsError
            For a time that is no number, or a displacement beyond the range of numbers.
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
        """Return the mechanical energy over that of the start, (n,); 1 where there was none.

        Scaled before it is squared, so that it is right for every amplitude that a number can hold.
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
    """Return every so many of the states after each step, displacement and velocity in turn: (n, 2), to their end."""
    stretch = every * max(1, STRETCH // every)
    parts = []
    for start in range(0, steps, stretch):
        found = np.fromiter(itertools.islice(states, 2 * min(stretch, steps - start)), np.float64).reshape(-1, 2)
        parts.append(found[every - 1 :: every].copy())
        if len(found) < stretch:
            break
    return np.concatenate(parts)


def with_start(problem: Problem, y: F8, v: F8) -> tuple[F8, F8]:
    """Return displacements and velocities (n + 1,) with the start before those (n,) after it."""
    return np.concatenate([[problem.displacement_m], y]), np.concatenate([[problem.velocity_m_per_s], v])


def demand_times(step_s: float, seconds: float) -> None:
    """Refuse a step or a duration that is none, or at which numbers end.

    Raises
    ------
    DynamicsError
    """
    for name, value in (("step", step_s), ("duration", seconds)):
        if not SHORTEST_S <= value <= LONGEST_S:
            raise DynamicsError(f"the {name} must be between {SHORTEST_S:g} and {LONGEST_S:g} s, got {value!r}")
