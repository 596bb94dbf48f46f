"""Solve a motion to a tolerance by step halving, which also estimates the error.

1. Solve with a step h and with h / 2. The maximum difference of the two runs is the stated error of the finer one.
2. Halve the step until the stated error is within the tolerance.
3. If two halvings do not reduce the difference, only rounding remains, and the tolerance is refused.
4. DOP853 chooses its own steps; there the tolerance is divided by ten instead of halving the step.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from pipeline.dynamics.equation import Problem
from pipeline.dynamics.integrator import MOST_STEPS, Integrator, Trajectory, demand_times
from pipeline.dynamics.strang import EXACT, STRANG
from pipeline.errors import DynamicsError
from pipeline.simulation.methods import LEAST_RTOL, SolveIvp


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """A solved motion with its stated error.

    The errors of displacement and velocity are relative to the starting amplitude and its product with the angular
    frequency; they are None if halving cannot estimate them.
    """

    integrator: Integrator
    parts: int  # steps from one kept state to the next
    problem: Problem
    trajectory: Trajectory
    error: float | None
    velocity_error: float | None
    no_estimate: str = ""
    running_s: float = 0.0  # of the returned run
    chosen: bool = False  # whether ``auto`` chose the method

    @property
    def step_s(self) -> float:
        """The step, s."""
        return self.trajectory.spacing_s / self.parts


def auto(
    problem: Problem, spacing_s: float, count: int, tolerance: float, timer: Callable[[], float] = lambda: 0.0
) -> Solution:
    """Solve a motion to a tolerance: a linear scene by its exact flow, every other one by Strang splitting.

    Parameters
    ----------
    problem : Problem
    spacing_s : float
        Time from one kept state to the next, s.
    count : int
        Number of spacings.
    tolerance : float
        Maximum error of the displacement relative to the starting amplitude.
    timer : callable
        Returns a time in seconds; it measures the returned run.

    Raises
    ------
    DynamicsError
        If the tolerance is below the limit of double precision, or the method does not reach it.
    """
    method = EXACT if problem.equation.is_linear else STRANG
    return replace(halved(problem, method, spacing_s, count, tolerance, timer), chosen=True)


def halved(
    problem: Problem,
    integrator: Integrator,
    spacing_s: float,
    count: int,
    tolerance: float,
    timer: Callable[[], float] = lambda: 0.0,
) -> Solution:
    """Solve a motion by one method and halve its step until the stated error is within a tolerance.

    With an error of :math:`c h^p` the difference of two runs is :math:`2^p - 1` times the error of the finer run. The
    rounding error of the phase is common to both runs and is therefore added; no tolerance is below twice its size.
    """
    rounding = rounding_error(problem, spacing_s * count)
    demand_times(spacing_s, spacing_s * count)
    if not 2.0 * rounding <= tolerance < math.inf:
        reach = f"at least {2.0 * rounding:.1e}, what double precision can reach in {spacing_s * count:g} s"
        raise DynamicsError(f"the tolerance must be finite and {reach}, got {tolerance:g}")
    refused = f"{integrator.name} cannot keep a tolerance of {tolerance:.3g} here"
    if why := integrator.refusal(problem):
        raise DynamicsError(f"{refused}: {why}", "take strang or auto")
    if why := integrator.no_estimate(problem):
        raise DynamicsError(f"{refused}: {why}")
    if integrator is EXACT:
        started, run = timer(), EXACT.run(problem, spacing_s, count)
        return Solution(EXACT, 1, problem, run, rounding, rounding, running_s=timer() - started)
    coarse, errors = None, [math.inf]
    for setting, parts in _settings(integrator, problem, spacing_s, count, tolerance):
        started, fine = timer(), None
        with contextlib.suppress(DynamicsError):  # too long a step may overflow
            fine = setting.run(problem, spacing_s / parts, count * parts, every=parts)
        running_s = timer() - started
        if coarse is not None and fine is not None:
            error, velocity_error = (each + rounding for each in _difference(fine, coarse))
            if error <= tolerance:
                return Solution(setting, parts, problem, fine, error, velocity_error, running_s=running_s)
            errors.append(error)
            if error >= errors[-3:][0]:
                refused += f": rounding leaves {min(errors):.2g}"
                break
            if integrator.order and parts * count * (error / tolerance) ** (1.0 / integrator.order) > MOST_STEPS:
                refused += ": it needs too many steps"
                break
        coarse = fine
    raise DynamicsError(refused, "take a larger tolerance or a shorter run")


def solved_once(
    problem: Problem, integrator: Integrator, spacing_s: float, count: int, timer: Callable[[], float] = lambda: 0.0
) -> Solution:
    """Solve a motion with the spacing as the step, and estimate the error from a second run with half this step.

    With an error of :math:`c h^p`, that of the longer step is :math:`2^p / (2^p - 1)` times the difference.
    """
    started = timer()
    run = integrator.run(problem, spacing_s, count)
    running_s = timer() - started
    error = velocity_error = None
    if not (why := integrator.no_estimate(problem)):
        apart = (math.inf, math.inf)
        with contextlib.suppress(DynamicsError):  # too long a step may overflow
            apart = _difference(run, integrator.run(problem, 0.5 * spacing_s, 2 * count, every=2))
        share, rounding = 1.0 / (1.0 - 0.5**integrator.order), rounding_error(problem, spacing_s * count)
        error, velocity_error = (share * each + rounding for each in apart)
    return Solution(integrator, 1, problem, run, error, velocity_error, why, running_s)


def rounding_error(problem: Problem, seconds: float) -> float:
    """Return the error of the displacement by rounding of the phase :math:`\\omega t`, relative to the amplitude."""
    return float(np.finfo(np.float64).eps) * (4.0 + problem.equation.angular_frequency_per_s * seconds)


def _settings(
    integrator: Integrator, problem: Problem, spacing_s: float, count: int, tolerance: float
) -> Iterator[tuple[Integrator, int]]:
    """Yield the method and its steps per spacing, doubled each time; scipy's tolerance is divided by ten instead."""
    omega = problem.equation.angular_frequency_per_s
    if isinstance(integrator, SolveIvp):
        # The errors of all steps accumulate, and a step is about one radian.
        rtol = max(min(tolerance / (1.0 + omega * spacing_s * count), 1e-3), 10.0 * LEAST_RTOL)
        yield from (
            (replace(integrator, rtol=rtol / tens), 1) for tens in 10.0 ** np.arange(14) if rtol / tens >= LEAST_RTOL
        )
        return
    # Drag stronger than the spring has its own, shorter time scale, which the step must resolve.
    fast = omega * (1.0 + abs(problem.equation.drag_per_m) * problem.amplitude_m())
    longest = min(1.0 / fast, integrator.stable_step(problem) or math.inf)
    parts = math.floor(min(spacing_s / longest, MOST_STEPS)) + 1
    while parts * count <= MOST_STEPS:
        yield integrator, parts
        parts *= 2


def _difference(one: Trajectory, other: Trajectory) -> tuple[float, float]:
    """Return the maximum differences of displacement and velocity, relative to amplitude and speed at the start."""
    size = one.problem.amplitude_m() or 1.0
    speed = size * one.problem.equation.angular_frequency_per_s
    return float(np.max(np.abs(one.y - other.y))) / size, float(np.max(np.abs(one.v - other.v))) / speed
