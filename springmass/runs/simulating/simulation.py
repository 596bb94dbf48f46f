"""A simulation: what is solved, by which integrator, what error was expected of it and what it has."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pipeline.dynamics import Problem, Trajectory, get_integrator
from pipeline.dynamics.band import Band
from pipeline.dynamics.choose import SAFETY, Choice, choose, cost_ns, demand_tolerance, fit_step
from pipeline.dynamics.integrators.exact import closed_form
from pipeline.dynamics.integrators.strang import STRANG
from pipeline.dynamics.integrators.taylor import TAYLOR
from pipeline.dynamics.prediction.rounding import expected_rounding
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
    "plan",
    "simulate",
]

DEFAULT_TOLERANCE = 1e-6
FINE = 24.0  # states a radian between which an interpolation errs by 1e-8 of the amplitude
BAND_SHARE, LARGEST_DEFAULT = 0.01, 1e-3
MOST_SAMPLES = 20_000_000
REFERENCE_TOLERANCE = 1e-16  # asked of a Taylor series: its rounding is all that is left


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
    choice : Choice
        Integrator, step, prediction, and the terms that were solved.
    trajectory : Trajectory
    check : Check or None
        The error, where it was asked for.
    choosing_s, running_s : float
        What choosing and running took, s.
    """

    problem: Problem
    choice: Choice
    trajectory: Trajectory
    check: Check | None = None
    choosing_s: float = 0.0
    running_s: float = 0.0


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


def plan(problem: Problem, method: str, spacing_s: float, count: int, tolerance: float | None) -> Choice:
    """Return what is to be run: the choice of ``auto``, or a method by name.

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
        Largest error over the amplitude; None: 1e-6 for auto, unbounded for a method by name.

    Raises
    ------
    DynamicsError
        For an unknown method, a tolerance below what can be reached, or a method that cannot keep it.
    """
    seconds = spacing_s * count
    if method == "auto":
        return choose(problem, spacing_s, count, DEFAULT_TOLERANCE if tolerance is None else tolerance)
    integrator = get_integrator(method)
    if tolerance is None:
        why = integrator.refusal(problem)
        if why:
            raise DynamicsError(f"{method} cannot solve this: {why}")
        return Choice(integrator, 1, spacing_s, seconds, cost_ns(integrator, problem, 1, count, seconds), problem)
    demand_tolerance(problem, seconds, tolerance)
    found = fit_step(integrator, problem, spacing_s, count, tolerance / SAFETY)
    if found is None:
        why = integrator.refusal(problem) or "no step of it is predicted to; take auto or a larger tolerance"
        raise DynamicsError(f"{method} cannot keep a tolerance of {tolerance:g} here: {why}")
    return found


def default_tolerance(band: Band | None) -> float:
    """Return a hundredth of what is uncertain anyway, from 1e-6 to 1e-3, in one digit; 1e-6 without a band."""
    if band is None:
        return DEFAULT_TOLERANCE
    return float(f"{min(max(BAND_SHARE * band.relative_u, DEFAULT_TOLERANCE), LARGEST_DEFAULT):.1g}")


def demand_stable(choice: Choice, *, where: str) -> None:
    """Refuse a step beyond the limit of its method.

    Raises
    ------
    ProgramError
        With exit code 2; the line names the limit and the remedy.
    """
    limit = choice.integrator.stable_step(choice.problem)
    if choice.step_s <= limit:
        return
    words = choice.integrator.words
    told = f"its limit here is {_rounded_down(limit)} s" if limit > 0.0 else "it grows at any step without damping"
    remedy = f"take --dt {_rounded_down(limit)} or less, " if limit > 0.0 else "take "
    other = "auto" if choice.integrator is STRANG else "strang"
    if math.isinf(STRANG.stable_step(choice.problem)):
        other += ", which has no limit"
    raise ProgramError(
        f"{where}: {words} is unstable with a step of {choice.step_s:g} s: {told}; {remedy}--method {other}, "
        "or --force to run it all the same",
        USAGE,
    )


def simulate(
    problem: Problem,
    choose: Callable[[], Choice],
    spacing_s: float,
    count: int,
    *,
    check: bool,
    timer: Callable[[], float],
    planned: Callable[[Choice], None] | None = None,
) -> Simulation:
    """Choose, run, and where it is asked for measure the error.

    Parameters
    ----------
    problem : Problem
    choose : callable
        To the choice.
    spacing_s : float
    count : int
    check : bool
        Whether to measure the error, which costs more than the run.
    timer : callable
        To seconds; the difference of two calls is a time.
    planned : callable, optional
        Told the choice before it runs; may refuse it.

    Raises
    ------
    DynamicsError
        If nothing keeps the tolerance, or the numbers ran away.
    """
    start = timer()
    choice = choose()
    chosen = timer()
    if planned is not None:
        planned(choice)
    before = timer()
    trajectory = choice.run(count)
    done = timer()
    found = checked(problem, choice, trajectory, spacing_s, count) if check else None
    return Simulation(problem, choice, trajectory, found, choosing_s=chosen - start, running_s=done - before)


def checked(problem: Problem, choice: Choice, trajectory: Trajectory, spacing_s: float, count: int) -> Check:
    """Return the error of a trajectory against a method that is not its own.

    A linear problem is solved by its closed form in extended precision. Any other by Taylor series in half the longest
    step and of more terms than a run of ``taylor`` has; where these are too many steps, by Strang splitting in a
    quarter of the step.
    """
    seconds = spacing_s * count
    reference, words, resolution = _reference(problem, choice, spacing_s, count)
    start = problem.amplitude_m()
    if start == 0.0:
        return Check(reference, words, 0.0, 0.0, 0.0)
    speed = start * problem.equation.angular_frequency_per_s
    error = float(np.max(np.abs(trajectory.y - reference.y))) / start
    velocity = float(np.max(np.abs(trajectory.v - reference.v))) / speed
    # The closed form is good to the last digit of a state, all others to what many sums leave.
    own = 0.0 if problem.equation.is_linear else expected_rounding(problem, seconds, power=0.5)
    resolution = max(resolution * error, own, float(np.finfo(np.float64).eps))
    return Check(reference, words, max(error, resolution), max(velocity, resolution), resolution)


def _reference(problem: Problem, choice: Choice, spacing_s: float, count: int) -> tuple[Trajectory, str, float]:
    """Return a reference, how it was made, and what share of the difference to it may be its own."""
    if problem.equation.is_linear and np.finfo(np.longdouble).eps < np.finfo(np.float64).eps:
        return closed_form(problem, spacing_s, count), "the closed form in extended precision", 0.0
    finer = replace(TAYLOR, tolerance=REFERENCE_TOLERANCE, longest=0.5 * TAYLOR.longest)
    if not finer.refusal(problem) and math.isfinite(finer.predicted_error(problem, spacing_s, spacing_s * count)):
        return finer.run(problem, spacing_s, count), "Taylor series in half the step", 0.0
    parts = 4 * (
        choice.parts if choice.integrator.name == "strang" else _strang_parts(problem, choice, spacing_s, count)
    )
    run = STRANG.run(problem, spacing_s / parts, count * parts, every=parts)
    return run, f"Strang splitting in {parts} steps a sample", 1.0 / 15.0


def _strang_parts(problem: Problem, choice: Choice, spacing_s: float, count: int) -> int:
    found = fit_step(STRANG, problem, spacing_s, count, max(choice.predicted_error, REFERENCE_TOLERANCE))
    if found is None:
        raise DynamicsError(
            "nothing solves this scene well enough to check an error against; leave --check out, or take a shorter run"
        )
    return found.parts


def _rounded_down(limit: float) -> str:
    """A limit in three digits, never above itself."""
    power = 10.0 ** (math.floor(math.log10(limit)) - 2)
    return f"{math.floor(limit / power) * power:.3g}"
