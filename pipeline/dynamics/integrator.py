"""The base class of all integrators, the trajectory that they return, and the checks common to all of them."""

from __future__ import annotations

import itertools
import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pipeline.dynamics.equation import Problem
from pipeline.errors import DynamicsError
from pipeline.numerics.levels import LARGEST
from pipeline.track import F8

RANAWAY = math.sqrt(math.sqrt(np.finfo(np.float64).max))  # m or m/s, whose fourth power is still a number
MOST_STEPS = 2**25  # of one run; measured: about ten seconds, and the finest of step halving takes half of its time


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
        """Return the step in s beyond which free motion is known to grow; inf if none is known, 0 if every step is."""
        return math.inf

    def no_estimate(self, problem: Problem) -> str:  # noqa: ARG002 - for some it depends on the problem
        """Return why step halving cannot estimate the integrator's error; empty if it can."""
        return ""

    @abstractmethod
    def march(self, problem: Problem, step_s: float, steps: int, every: int) -> tuple[F8, F8]:
        """Return displacements and velocities (n,) at the start and after every ``every`` steps, m and m/s."""

    def run(self, problem: Problem, step_s: float, steps: int, *, every: int = 1) -> Trajectory:
        """Solve a problem by some steps of a length in s, of which every n-th is kept.

        A :class:`DynamicsError` says what is wrong with the step or the number of steps, why the method cannot solve
        this problem, or that the solution overflows.
        """
        demand_times(step_s, step_s * steps)
        if steps < 1 or every < 1 or steps % every:
            raise DynamicsError(
                f"the number of steps must be a positive multiple of {max(every, 1)}, of which one is kept, got {steps}"
            )
        why = self.refusal(problem)
        if why:
            raise DynamicsError(f"{self.name} cannot solve this: {why}", "take strang or auto")
        ran_away, remedy = f"{self.name} ran beyond the range of numbers", "take a shorter step, or auto"
        with np.errstate(all="ignore"):
            try:
                y, v = self.march(problem, step_s, steps, every)
            except (OverflowError, ZeroDivisionError) as error:
                raise DynamicsError(f"{ran_away} ({error})", remedy) from error
        fine = (np.abs(y) < RANAWAY) & (np.abs(v) < RANAWAY)
        if not fine.all():
            raise DynamicsError(f"{ran_away} by t = {step_s * every * int(np.argmin(fine)):g} s", remedy)
        return Trajectory(problem, step_s * every, y, v)


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
        """
        place = np.clip(np.asarray(t) / self.spacing_s, 0.0, len(self.y) - 1.0)
        row = np.minimum(place.astype(np.intp), len(self.y) - 2)
        x = place - row
        y, v = self.y, self.v * self.spacing_s
        rise = x * x * (3.0 - 2.0 * x)
        bends = x * (1.0 - x) * ((1.0 - x) * v[row] - x * v[row + 1])
        return np.asarray((1.0 - rise) * y[row] + rise * y[row + 1] + bends)

    def relative_energy(self) -> F8:
        """Return the mechanical energy (n,) relative to that at the start; 1 if the start has none, inf on overflow."""
        size, eq = self.problem.amplitude_m(), self.problem.equation
        if size == 0.0:
            return np.ones(len(self.y))
        # In units of the amplitude, so that no small one is lost in its square.
        y, v = self.y / size, self.v / (size * eq.angular_frequency_per_s)
        cubic = 0.5 * eq.cubic_per_m2_s2 * (size / eq.angular_frequency_per_s) ** 2
        with np.errstate(over="ignore"):
            energy = v**2 + y**2 * (1.0 + cubic * y**2)
        return np.asarray(energy / energy[0])


def kept(problem: Problem, states: Iterator[float], count: int) -> tuple[F8, F8]:
    """Return the start and ``count`` later states from an iterator of displacements and velocities in alternation."""
    start = (problem.displacement_m, problem.velocity_m_per_s)
    found = np.fromiter(itertools.chain(start, itertools.islice(states, 2 * count)), np.float64, 2 * count + 2)
    return found[0::2].copy(), found[1::2].copy()


def demand_times(step_s: float, seconds: float) -> None:
    """Refuse a step or a duration that is not positive or beyond every bench."""
    for name, value in (("step", step_s), ("duration", seconds)):
        if not 1.0 / LARGEST <= value <= LARGEST:
            raise DynamicsError(f"the {name} must be between {1.0 / LARGEST:g} and {LARGEST:g} s, got {value!r}")
