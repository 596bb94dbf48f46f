"""The error of a long run from a few of its cycles."""

from __future__ import annotations

import functools
import math

import numpy as np

from pipeline.dynamics.integrator import Integrator
from pipeline.dynamics.prediction.envelope import frequency, slow_rate
from pipeline.dynamics.prediction.growth import FAR, Rates, grown, levels, slow_from
from pipeline.dynamics.prediction.pilot import (
    compared,
    fine_step,
    in_own_units,
    predicted_by_pilot,
    resonance,
    scatter,
)
from pipeline.dynamics.problem import Problem
from pipeline.errors import DynamicsError

__all__ = ["predicted"]

CYCLES = 3
ROUNDED = 2e-14  # of the amplitude: a difference that rounding may make
DEAD = 9.0  # decay times after which a ten-thousandth is left
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
    fine = fine_step(problem)
    if since >= seconds:
        # What comes after the motion has died away errs by less than what came before.
        seconds = min(seconds, DEAD / slow_rate(problem.equation)) if problem.equation.gamma_per_s else seconds
        return predicted_by_pilot(integrator, solver, problem, step_s, seconds, pilots=pilots, of_velocity=of_velocity)
    # A step so long that a cycle has few of them errs by more than a finer one's power says, or as much: refused alike.
    coarse = max(1.0, problem.equation.angular_frequency_per_s * step_s / MOST_PILOT) if integrator.order else 1.0
    step_s /= coarse
    pilot = max(step_s, fine) if integrator.order else fine
    first = predicted_by_pilot(integrator, solver, problem, step_s, since, pilots=pilots, of_velocity=of_velocity)
    if not math.isfinite(first):
        return first
    at, own, unscaled = _added_up(
        integrator, solver, problem, step_s if pilot > fine else 0.0, seconds, since, of_velocity
    )
    order = min(integrator.order, 3) if problem.equation.is_kinked else integrator.order
    power = (step_s / own) ** order if order else 1.0
    if unscaled * max(power, 1.0) > FAR:  # no longer in proportion
        rates = Rates(at.amplitude, at.of_amplitude * power, at.of_phase * power)
        error = first + grown(problem, seconds, since, rates, of_velocity=of_velocity)
    else:
        error = first + unscaled * power
    if integrator is solver:
        error += resonance(problem, step_s, seconds)
    elif order:
        error += scatter(problem, step_s, seconds)
    return error * coarse**order


@functools.lru_cache(maxsize=16)
def _added_up(
    integrator: Integrator,
    solver: Integrator,
    problem: Problem,
    step_s: float,
    seconds: float,
    since: float,
    of_velocity: bool,
) -> tuple[Rates, float, float]:
    """Return rates, the step of the pilot that shows them, s, and what error they make in it."""
    rates, pilot = _rates(integrator, solver, problem, step_s, seconds, since)
    return rates, pilot, grown(problem, seconds, since, rates, of_velocity=of_velocity)


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
    omega = eq.angular_frequency_per_s
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
    # Along the motion a difference is one of time, across it one of size.
    (y, v), (dy, dv) = ((float(z.real), omega * float(z.imag)) for z in (truth[-1], found[-1] - truth[-1]))
    if not math.hypot(dy, dv / omega) > ROUNDED * start:  # which has a prediction of its own
        return 0.0, 0.0
    pull, stiff = float(eq.spring(y)), omega**2 + eq.cubic_per_m2_s2 * start * start
    of_size = (v * dv + pull * dy) / (v * v + pull * y)
    of_time = (dy * v - dv * pull / stiff) / (v * v + pull * pull / stiff)
    scale = (pilot / step) ** integrator.order / long
    return of_size * scale, of_time * pace * scale
