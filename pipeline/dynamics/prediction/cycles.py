"""The error of a long run from a few of its cycles."""

from __future__ import annotations

import functools
import math

import numpy as np

from pipeline.dynamics.integrator import Integrator
from pipeline.dynamics.prediction.envelope import frequency
from pipeline.dynamics.prediction.growth import FAR, Rates, grown, levels, slow_from
from pipeline.dynamics.prediction.pilot import (
    compared,
    fine_step,
    in_own_units,
    is_kinked,
    predicted_by_pilot,
    resonance,
    scatter,
)
from pipeline.dynamics.problem import Problem
from pipeline.errors import DynamicsError

__all__ = ["predicted"]

CYCLES = 3
ROUNDED = 2e-14  # of the amplitude: a difference that rounding may make
MOST_PILOT = 1.0  # radians a step up to which cycles are looked at in steps


def predicted(
    integrator: Integrator,
    solver: Integrator,
    problem: Problem,
    step_s: float,
    seconds: float,
    pilots: int = 3,
    *,
    of_velocity: bool = False,
) -> float:
    """Return the expected largest error of the displacement over the starting amplitude, or of the velocity.

    Parameters
    ----------
    integrator, solver, problem, step_s, seconds, pilots, of_velocity
        As of :func:`pipeline.dynamics.prediction.pilot.predicted_by_pilot`.

    Notes
    -----
    A motion that loses little of its amplitude a cycle is not run to its end: after its first cycles three more are
    run from rest at some of the amplitudes that it passes, and what they add to the errors of amplitude and phase is
    summed along the averaged motion. The cost is that of some hundred steps, however long the run.
    Three cycles take a number of steps with which no turning point falls into a step as another one does.
    """
    if problem.amplitude_m() == 0.0:
        return 0.0
    problem = in_own_units(problem)
    since = slow_from(problem, seconds)
    pilot = fine_step(problem) if integrator.order == 0 else max(step_s, fine_step(problem))
    if since >= seconds or pilot * problem.equation.angular_frequency_per_s > MOST_PILOT:
        return predicted_by_pilot(integrator, solver, problem, step_s, seconds, pilots=pilots, of_velocity=of_velocity)
    first = predicted_by_pilot(integrator, solver, problem, step_s, since, pilots=pilots, of_velocity=of_velocity)
    if not math.isfinite(first):
        return first
    at = _rates(integrator, solver, problem, step_s if pilot > fine_step(problem) else 0.0, seconds, since)
    order = min(integrator.order, 3) if is_kinked(problem.equation) else integrator.order
    power = (step_s / at[1]) ** order if order else 1.0
    rates = Rates(at[0].amplitude, at[0].of_amplitude * power, at[0].of_phase * power)
    error = first + grown(problem, seconds, since, rates, of_velocity=of_velocity)
    if integrator is solver:
        return error + resonance(problem, step_s, seconds)
    return error + (scatter(problem, step_s, seconds) if order else 0.0)


@functools.lru_cache(maxsize=16)
def _rates(
    integrator: Integrator, solver: Integrator, problem: Problem, step_s: float, seconds: float, since: float
) -> tuple[Rates, float]:
    """Return the rates in a pilot's step, and that step: that of the run, s, or 0 for one that is fine."""
    pilot = max(step_s, fine_step(problem))
    while True:
        rates = Rates.at(
            levels(problem, seconds, since),
            problem.equation,
            functools.partial(_added, integrator, solver, pilot),
        )
        cycle = 2.0 * math.pi / problem.equation.angular_frequency_per_s
        most = CYCLES * cycle * float(np.max(np.hypot(rates.of_amplitude, rates.of_phase)))
        if most <= FAR or not integrator.order or pilot <= 1e-3 * cycle:
            return rates, pilot
        pilot *= 0.25


def _added(integrator: Integrator, solver: Integrator, pilot: float, problem: Problem) -> tuple[float, float]:
    """Return what a second adds to the errors of amplitude, relative, and phase, from whole cycles."""
    eq, start = problem.equation, problem.displacement_m
    pace = float(frequency(eq, np.array([start]))[0])
    pace = math.sqrt(max(pace * pace - eq.gamma_per_s**2, 1e-12 * pace * pace))
    long = CYCLES * 2.0 * math.pi / pace
    fine = fine_step(problem)
    step = min(pilot, long / 12.0)
    steps = math.ceil(long / step)
    while math.gcd(steps, 6) > 1:
        steps += 1
    step = long / steps
    parts = min(math.ceil(step / fine * (1.0 - 1e-12)), 4)
    try:
        found, truth = compared(integrator, solver, problem, step, parts, long)
    except DynamicsError:
        return math.inf, math.inf
    with np.errstate(all="ignore"):
        off = np.log(found[-1] / truth[-1])
    if not abs(off) > ROUNDED:  # which has a prediction of its own
        return 0.0, 0.0
    bend = eq.cubic_per_m2_s2 * start * start
    as_phase = eq.angular_frequency_per_s * pace / (eq.angular_frequency_per_s**2 + bend)
    scale = (pilot / step) ** integrator.order
    return float(off.real) / long * scale, float(off.imag) * as_phase / long * scale
