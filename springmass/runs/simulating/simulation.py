"""A simulation: the problem, the integrator, the error estimate and the measured error."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pipeline.dynamics import Problem, Trajectory, get_integrator
from pipeline.dynamics.band import Band
from pipeline.dynamics.halving import Solution, auto, demand_tolerance, halved, rounding_error, solved_once
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
FINE = 24.0  # states per radian; interpolation between them has an error of 1e-8 of the amplitude
BAND_SHARE, LARGEST_DEFAULT = 0.01, 1e-3
MOST_SAMPLES = 20_000_000
REFERENCE_RTOL = 1e-13


@dataclass(frozen=True, slots=True, eq=False)
class Check:
    """The error of a trajectory, measured against another method.

    Parameters
    ----------
    reference : Trajectory
        Reference solution at the times of the trajectory.
    words : str
        How the reference was made.
    error, velocity_error : float
        Maximum differences of displacement and velocity, relative to the starting amplitude and to its product with the
        angular frequency; never below the resolution.
    resolution : float
        Possible error of the reference itself, relative to the starting amplitude.
    """

    reference: Trajectory
    words: str
    error: float
    velocity_error: float
    resolution: float


@dataclass(frozen=True, slots=True, eq=False)
class Simulation:
    """A trajectory with its error.

    Parameters
    ----------
    problem : Problem
        The problem with everything that the scene states.
    solution : Solution
        Trajectory, integrator, step, stated error, and the terms that were solved.
    check : Check or None
        The measured error, if it was requested.
    choosing_s : float
        Time spent on choosing method and step, s; it covers all runs except the one that is returned.
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
    """A measured run with a prediction overlaid.

    Parameters
    ----------
    t, measured, predicted : (n,) float64
        Time in s, measured and predicted distance in m, of the samples used.
    rms_m : float
        Root mean square of measured minus predicted, m.
    noise_m : float
        Noise of one sample from the analysis, m.
    band : (4, n) float64 or None
        Quantiles of the predicted distance relative to ``predicted``, m, as in :class:`pipeline.dynamics.band.Band`.
    inside : float or None
        Fraction of the samples within the 95 % band widened by the noise; None without a band.
    leaves_s : float or None
        Time at which the record leaves the widened band, s; None if it never does.
    moves : tuple of Move
        The change in each input alone that fits the record best, with the input that explains the most first.
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
    """The change of one input that brings the prediction closest to the record.

    Parameters
    ----------
    name : str
    given, value : float
        The scene's value, and the value that fits the record best.
    in_u : float
        The change in standard uncertainties.
    rms_m : float
        Root mean square of the remaining residuals, m.
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
        With exit code 2 if the number is zero, or too large for the memory of a machine.
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
    """Solve a motion with ``auto`` or with a named method.

    Parameters
    ----------
    problem : Problem
    method : str
        "auto" or a name of :data:`pipeline.dynamics.INTEGRATORS`.
    spacing_s : float
        Time between samples, s. It is also the step if a method is named without a tolerance.
    count : int
        Number of spacings.
    tolerance : float or None
        Maximum error relative to the amplitude; None: 1e-6 for "auto" and for methods without a step, and no limit for
        methods with a step.
    timer : callable
        Returns a time in seconds.

    Raises
    ------
    DynamicsError
        If the method is unknown, or the tolerance cannot be reached at all or not by this method.
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
    """Return 1 % of the band's relative uncertainty, limited to 1e-6 to 1e-3, in one digit; 1e-6 without a band."""
    if band is None:
        return DEFAULT_TOLERANCE
    return float(f"{min(max(BAND_SHARE * band.relative_u, DEFAULT_TOLERANCE), LARGEST_DEFAULT):.1g}")


def demand_stable(problem: Problem, method: str, step_s: float | None, *, where: str) -> None:
    """Refuse a step beyond the stability limit of its method.

    Parameters
    ----------
    problem : Problem
    method : str
    step_s : float or None
        None: the method may take any sufficiently short step.
    where : str
        Name of the scene in the error.

    Raises
    ------
    ProgramError
        With exit code 2 if the step is unstable; the message names the limit and the remedy.
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
    """Solve a motion, and optionally measure the error.

    Parameters
    ----------
    problem, method, spacing_s, count, tolerance
        As in :func:`solve`.
    check : bool
        Whether to measure the error, which takes longer than the run.
    timer : callable
        Returns seconds; the difference between two calls is the time elapsed.

    Raises
    ------
    DynamicsError
        If no method keeps the tolerance, or the numbers diverge.
    """
    started = timer()
    solution = solve(problem, method, spacing_s, count, tolerance, timer)
    choosing_s = timer() - started - solution.running_s
    found = checked(problem, solution, spacing_s, count) if check else None
    return Simulation(problem, solution, found, choosing_s)


def checked(problem: Problem, solution: Solution, spacing_s: float, count: int) -> Check:
    """Return the error of a solution relative to the reference."""
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
    """Return a highly accurate reference solution, how it was made, and its possible error.

    The method is DOP853 with a relative tolerance of 1e-13. With friction, or if DOP853 fails, it is Strang splitting
    with a quarter of the step.

    Parameters
    ----------
    problem, spacing_s, count
        As in :func:`solve`.
    strang_parts : int or None
        Steps per spacing of the run to check; None if that run does not use Strang splitting.

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
            pass  # the run is too long or too stiff for DOP853
        else:
            return run, f"DOP853 at {REFERENCE_RTOL:g}", apart + rounding
    parts = 4 * (strang_parts or halved(problem, STRANG, spacing_s, count, DEFAULT_TOLERANCE).parts)
    run, coarse = (STRANG.run(problem, spacing_s / each, count * each, every=each) for each in (parts, parts // 2))
    # For a second-order method, the difference from a run with twice the step is three times the finer run's error.
    return run, f"Strang splitting in {parts} steps a sample", _apart(run, coarse) / 3.0 + rounding


def _apart(one: Trajectory, other: Trajectory) -> float:
    """Return the maximum difference between two motions relative to the starting amplitude."""
    start = one.problem.amplitude_m()
    return float(np.max(np.abs(one.y - other.y))) / start if start else 0.0


def _rounded_down(limit: float) -> str:
    """Return a limit rounded down to three digits."""
    power = 10.0 ** (math.floor(math.log10(limit)) - 2)
    return f"{math.floor(limit / power) * power:.3g}"
