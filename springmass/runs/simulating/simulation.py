"""A simulation: what is solved, by which integrator, what error is stated of it and what error it has."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pipeline.dynamics import Problem, Trajectory, get_integrator
from pipeline.dynamics.band import Band
from pipeline.dynamics.halving import Solution, auto, demand_tolerance, halved, solved_once
from pipeline.dynamics.rounding import rounding_error
from pipeline.dynamics.solve_ivp import DOP853
from pipeline.dynamics.strang import STRANG
from pipeline.errors import DynamicsError
from pipeline.track import F8
from springmass.errors import USAGE, ProgramError

__all__ = [
    "FINE",
    "Against",
    "Check",
    "Move",
    "Simulation",
    "checked",
    "count_of",
    "default_tolerance",
    "demand_stable",
    "reference",
    "simulate",
    "solve",
]

DEFAULT_TOLERANCE = 1e-6
FINE = 24.0  # states a radian between which an interpolation errs by 1e-8 of the amplitude
BAND_SHARE, LARGEST_DEFAULT = 0.01, 1e-3
MOST_SAMPLES = 20_000_000
REFERENCE_RTOL = 1e-13


@dataclass(frozen=True, slots=True, eq=False)
class Check:
    """The error of a trajectory, against another method.

    Parameters
    ----------
    reference : Trajectory
        At the same times.
    words : str
        How it was made.
    error, velocity_error : float
        Largest differences of displacement and velocity, over the starting amplitude and over that times the angular
        frequency; at least what the reference resolves.
    resolution : float
        What the reference may err by itself, over the amplitude.
    """

    reference: Trajectory
    words: str
    error: float
    velocity_error: float
    resolution: float


@dataclass(frozen=True, slots=True, eq=False)
class Simulation:
    """A trajectory with what is known of its error.

    Parameters
    ----------
    problem : Problem
        All that the scene states.
    solution : Solution
        Trajectory, integrator, step, stated error, and the terms that were solved.
    check : Check or None
        The error, where it was asked for.
    choosing_s : float
        What choosing took, s: all runs but the one that is returned.
    """

    problem: Problem
    solution: Solution
    check: Check | None = None
    choosing_s: float = 0.0

    @property
    def trajectory(self) -> Trajectory:
        """The solved motion."""
        return self.solution.trajectory


@dataclass(frozen=True, slots=True, eq=False)
class Against:
    """A measured run with the prediction laid over it.

    Parameters
    ----------
    t, measured, predicted : (n,) float64
        Of the samples used: s, m, m.
    rms_m : float
        Root mean square of measured less predicted, m.
    noise_m : float
        Of one sample, m, as the analysis has it.
    band : (4, n) float64 or None
        Quantiles of the prediction less the prediction, m, as in :class:`pipeline.dynamics.band.Band`.
    inside : float or None
        Share of the samples within the 95 % of the band, widened by the noise; None without a band.
    leaves_s : float or None
        When the record leaves it, s.
    moves : tuple of Move
        What each input alone would have to be, the one that explains most first.
    """

    t: F8
    measured: F8
    predicted: F8
    rms_m: float
    noise_m: float
    band: F8 | None = None
    inside: float | None = None
    leaves_s: float | None = None
    moves: tuple[Move, ...] = ()


@dataclass(frozen=True, slots=True)
class Move:
    """An input moved so that the prediction comes nearest to the record.

    Parameters
    ----------
    name : str
    given, value : float
        The scene's value, and the one that it would have to be.
    in_u : float
        By how many standard uncertainties.
    rms_m : float
        What is left then, m.
    """

    name: str
    given: float
    value: float
    in_u: float
    rms_m: float


def count_of(seconds: float, spacing_s: float) -> int:
    """Return the number of spacings in a run.

    Raises
    ------
    ProgramError
        With exit code 2 if there are none, or more than a machine holds.
    """
    count = round(seconds / spacing_s) if spacing_s > 0 else 0
    if not 1 <= count <= MOST_SAMPLES:
        raise ProgramError(
            f"--seconds {seconds:g} at --dt {spacing_s:g} makes {count} steps; allowed are 1 to {MOST_SAMPLES}", USAGE
        )
    return count


def solve(
    problem: Problem,
    method: str,
    spacing_s: float,
    count: int,
    tolerance: float | None,
    timer: Callable[[], float] = lambda: 0.0,
) -> Solution:
    """Solve a motion by ``auto`` or by a method that was named.

    Parameters
    ----------
    problem : Problem
    method : str
        "auto" or a name of :data:`pipeline.dynamics.INTEGRATORS`.
    spacing_s : float
        Time between samples, s; the step of a method by name without a tolerance.
    count : int
        Number of spacings.
    tolerance : float or None
        Largest error over the amplitude; None: 1e-6 for methods without a step, no limit for those with one.
    timer : callable
        To seconds.

    Raises
    ------
    DynamicsError
        For an unknown method, a tolerance below what can be reached, or a method that cannot keep it.
    """
    if method == "auto":
        return auto(problem, spacing_s, count, DEFAULT_TOLERANCE if tolerance is None else tolerance, timer)
    integrator = get_integrator(method)
    if tolerance is None and integrator.order:
        return solved_once(problem, integrator, spacing_s, count, timer)
    if tolerance is not None:
        demand_tolerance(problem, spacing_s, count, tolerance)
    return halved(problem, integrator, spacing_s, count, DEFAULT_TOLERANCE if tolerance is None else tolerance, timer)


def default_tolerance(band: Band | None) -> float:
    """Return a hundredth of what is uncertain anyway, from 1e-6 to 1e-3, in one digit; 1e-6 without a band."""
    if band is None:
        return DEFAULT_TOLERANCE
    return float(f"{min(max(BAND_SHARE * band.relative_u, DEFAULT_TOLERANCE), LARGEST_DEFAULT):.1g}")


def demand_stable(problem: Problem, method: str, step_s: float | None, *, where: str) -> None:
    """Refuse a step beyond the limit of its method.

    Parameters
    ----------
    problem : Problem
    method : str
    step_s : float or None
        None where the method may take any step that is short enough.
    where : str
        Named in the error.

    Raises
    ------
    ProgramError
        With exit code 2; the line names the limit and the remedy.
    """
    if method == "auto":
        return
    integrator = get_integrator(method)
    limit = integrator.stable_step(problem)
    if limit > 0.0 and (step_s is None or step_s <= limit):
        return
    limit_text = (
        f"its limit here is {_rounded_down(limit)} s" if limit > 0.0 else "it grows at any step without damping"
    )
    remedy = f"take --dt {_rounded_down(limit)} or less, " if limit > 0.0 else "take "
    other = "auto" if integrator is STRANG else "strang"
    if math.isinf(STRANG.stable_step(problem)):
        other += ", which has no limit"
    step = "a step" if step_s is None else f"a step of {step_s:g} s"
    raise ProgramError(
        f"{where}: {integrator.words} is unstable with {step}: {limit_text}; {remedy}--method {other}, "
        "or --force to run it all the same",
        USAGE,
    )


def simulate(
    problem: Problem,
    method: str,
    spacing_s: float,
    count: int,
    tolerance: float | None,
    *,
    check: bool,
    timer: Callable[[], float],
) -> Simulation:
    """Solve a motion, and where it is asked for measure the error.

    Parameters
    ----------
    problem, method, spacing_s, count, tolerance
        As in :func:`solve`.
    check : bool
        Whether to measure the error, which costs more than the run.
    timer : callable
        To seconds; the difference of two calls is a time.

    Raises
    ------
    DynamicsError
        If nothing keeps the tolerance, or the numbers ran away.
    """
    started = timer()
    solution = solve(problem, method, spacing_s, count, tolerance, timer)
    choosing_s = timer() - started - solution.running_s
    found = checked(problem, solution, spacing_s, count) if check else None
    return Simulation(problem, solution, found, choosing_s)


def checked(problem: Problem, solution: Solution, spacing_s: float, count: int) -> Check:
    """Return the error of a solution against the reference."""
    trajectory = solution.trajectory
    parts = solution.parts if solution.integrator is STRANG else None
    other, words, resolution = reference(problem, spacing_s, count, parts)
    start = problem.amplitude_m()
    if start == 0.0:
        return Check(other, words, 0.0, 0.0, 0.0)
    speed = start * problem.equation.angular_frequency_per_s
    error = _apart(trajectory, other)
    velocity = float(np.max(np.abs(trajectory.v - other.v))) / speed
    return Check(other, words, max(error, resolution), max(velocity, resolution), resolution)


def reference(
    problem: Problem, spacing_s: float, count: int, strang_parts: int | None = None
) -> tuple[Trajectory, str, float]:
    """Return a motion solved far better than to a tolerance, how it was made, and what it may err by.

    By DOP853 at a relative tolerance of 1e-13. With friction, or where DOP853 gives up, by Strang splitting in a
    quarter of the step.

    Parameters
    ----------
    problem, spacing_s, count
        As in :func:`solve`.
    strang_parts : int or None
        Steps a spacing of the run that is checked; None where it is not of Strang splitting.

    Raises
    ------
    DynamicsError
        If neither solves the motion.
    """
    rounding = rounding_error(problem, spacing_s * count)
    if not problem.equation.friction_m_per_s2:
        finest, next_finest = (replace(DOP853, rtol=rtol) for rtol in (REFERENCE_RTOL, 10.0 * REFERENCE_RTOL))
        try:
            run = finest.run(problem, spacing_s, count)
            apart = _apart(run, next_finest.run(problem, spacing_s, count))
        except DynamicsError:
            pass  # too long, or too stiff
        else:
            return run, f"DOP853 at {REFERENCE_RTOL:g}", apart + rounding
    parts = 4 * (strang_parts or halved(problem, STRANG, spacing_s, count, DEFAULT_TOLERANCE).parts)
    run, coarse = (STRANG.run(problem, spacing_s / each, count * each, every=each) for each in (parts, parts // 2))
    # Of second order: the difference to twice the step is three times the error of the finer run.
    return run, f"Strang splitting in {parts} steps a sample", _apart(run, coarse) / 3.0 + rounding


def _apart(one: Trajectory, other: Trajectory) -> float:
    """Return the largest difference of two motions over the starting amplitude."""
    start = one.problem.amplitude_m()
    return float(np.max(np.abs(one.y - other.y))) / start if start else 0.0


def _rounded_down(limit: float) -> str:
    """A limit in three digits, never above itself."""
    power = 10.0 ** (math.floor(math.log10(limit)) - 2)
    return f"{math.floor(limit / power) * power:.3g}"
