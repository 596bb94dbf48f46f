"""A simulation: what is solved, by which integrator, what error was expected of it and what it has."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.dynamics import Problem, Trajectory, get_integrator
from pipeline.dynamics.band import LEVELS, Band
from pipeline.dynamics.choose import SAFETY, Choice, choose, cost_ns, demand_tolerance, fit_step, least_tolerance
from pipeline.dynamics.integrators.exact import EXACT
from pipeline.dynamics.integrators.strang import STRANG
from pipeline.dynamics.integrators.taylor import TAYLOR
from pipeline.errors import DynamicsError
from pipeline.track import F8
from springmass.errors import USAGE, ProgramError

__all__ = [
    "Against",
    "Simulation",
    "band_columns",
    "count_of",
    "demand_stable",
    "plan",
    "simulate",
    "summary",
    "truth",
]

DEFAULT_TOLERANCE = 1e-6
MOST_SAMPLES = 20_000_000


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
    truth : Trajectory
        The exact solution, or the most accurate one, at the same times.
    measured_error : float
        Largest difference of the displacements over the starting amplitude.
    """

    problem: Problem
    choice: Choice
    trajectory: Trajectory
    truth: Trajectory
    measured_error: float


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
    """

    t: F8
    measured: F8
    predicted: F8
    rms_m: float
    noise_m: float
    band: F8 | None = None


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
        error = integrator.predicted_error(problem, spacing_s, seconds)
        return Choice(integrator, 1, spacing_s, error, cost_ns(integrator, problem, 1, count, seconds), problem)
    demand_tolerance(problem, seconds, tolerance)
    found = fit_step(integrator, problem, spacing_s, count, tolerance / SAFETY)
    if found is None:
        why = integrator.refusal(problem) or "no step of it is predicted to; take auto or a larger tolerance"
        raise DynamicsError(f"{method} cannot keep a tolerance of {tolerance:g} here: {why}")
    return found


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
    raise ProgramError(
        f"{where}: {words} is unstable with a step of {choice.step_s:g} s: {told}; {remedy}--method strang, which "
        "has no limit, or --force to run it all the same",
        USAGE,
    )


def simulate(problem: Problem, choice: Choice, spacing_s: float, count: int) -> Simulation:
    """Run a choice and measure its error.

    Raises
    ------
    DynamicsError
        If the numbers ran away.
    """
    trajectory = choice.run(count)
    exact = truth(problem, spacing_s, count, choice.predicted_error)
    start = problem.amplitude_m()
    error = float(np.max(np.abs(trajectory.y - exact.y))) / start if start > 0 else 0.0
    return Simulation(problem, choice, trajectory, exact, error)


def truth(problem: Problem, spacing_s: float, count: int, below: float = math.inf) -> Trajectory:
    """Return the exact solution of a linear problem, else the adaptive Taylor series, else Strang in fine steps.

    Parameters
    ----------
    problem : Problem
    spacing_s : float
    count : int
    below : float
        An error that is to be measured: Strang's steps are made fine enough for it.
    """
    for integrator in (EXACT, TAYLOR):
        if not integrator.refusal(problem):
            return integrator.run(problem, spacing_s, count)
    least = least_tolerance(problem, spacing_s * count)
    for wanted in (max(least, 0.01 * min(below, 1e-2)), 1e-6, 1e-3):
        found = fit_step(STRANG, problem, spacing_s, count, wanted)
        if found is not None:
            return found.run(count)
    raise DynamicsError("no integrator solves this scene well enough to measure an error against; take a shorter run")


def summary(simulation: Simulation, against: Against | None, band: Band | None) -> dict[str, Any]:
    """Return a simulation as the JSON of ``springmass simulate``."""
    choice, problem = simulation.choice, simulation.problem
    limit = choice.integrator.stable_step(choice.problem)
    return {
        "schema": 1,
        "method": choice.integrator.name,
        "step_s": choice.step_s,
        "steps": choice.parts * (len(simulation.trajectory.y) - 1),
        "samples": len(simulation.trajectory.y),
        "spacing_s": simulation.trajectory.spacing_s,
        "stable_step_s": limit if math.isfinite(limit) else None,
        "predicted_error": choice.predicted_error if math.isfinite(choice.predicted_error) else None,
        "measured_error": simulation.measured_error,
        "amplitude_m": problem.amplitude_m(),
        "equation": {name: getattr(problem.equation, name) for name in problem.equation.__slots__},
        "terms": [
            {"name": term.name, "size": term.size, "included": term.included, "why": term.why} for term in choice.terms
        ],
        "against": None if against is None else {"rms_m": against.rms_m, "noise_m": against.noise_m},
        "band": None if band is None else _band_summary(band, simulation.trajectory.t),
    }


def band_columns(band: Band, t: F8, predicted: F8) -> dict[str, F8]:
    """Return quantiles of displacement and amplitude as columns (n,), m, by name.

    Parameters
    ----------
    band : Band
    t : (n,) float64, s
    predicted : (n,) float64, m
        The displacement, or the distance, of the scene's values.
    """
    amplitude, of_amplitude = band.amplitude_at(t)
    around = predicted + band.displacement_at(t)
    return {
        **{f"displacement_{level}_m": each for level, each in zip(LEVELS, around, strict=True)},
        "amplitude_m": amplitude,
        **{f"amplitude_{level}_m": each for level, each in zip(LEVELS, of_amplitude, strict=True)},
    }


def _band_summary(band: Band, t: F8) -> dict[str, Any]:
    """Half widths are the largest over the run."""
    around, (_, of_amplitude) = band.displacement_at(t), band.amplitude_at(t)
    widths = {
        f"{name}_half_width_{share}_m": float(0.5 * np.max(found[high] - found[low]))
        for name, found in (("displacement", around), ("amplitude", of_amplitude))
        for share, low, high in ((68, 1, 2), (95, 0, 3))
    }
    return {"members": band.members, "seed": band.seed, "quantities": list(band.quantities), **widths}


def _rounded_down(limit: float) -> str:
    """A limit in three digits, never above itself."""
    power = 10.0 ** (math.floor(math.log10(limit)) - 2)
    return f"{math.floor(limit / power) * power:.3g}"
