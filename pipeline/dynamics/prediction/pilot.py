"""What error to expect of a run before it is made: by rounding, and as a pilot run shows it.

A pilot is the whole motion in coarse steps, beside the same in finer ones.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pipeline.dynamics.amplitude import stopping_time
from pipeline.dynamics.integrator import Integrator
from pipeline.dynamics.problem import Problem
from pipeline.errors import DynamicsError
from pipeline.track import F8

C16 = NDArray[np.complex128]

__all__ = [
    "bounded",
    "compared",
    "fine_step",
    "in_own_units",
    "predicted_by_pilot",
    "resonance",
    "scatter",
]

FINE = 0.25  # radians a step, of the spring, of drag and of quadratic drag together: there the power law holds
FAR = 0.1  # of the amplitude: an error beyond it follows the power law no more
LOOKS = 6  # times at which a resonance is looked at, each twice the one before
PLAIN_SHARES = (1.0, 0.9, 0.5)  # of a pilot's step: where in it a bob turns sets the error of a method that is not told
STIFF = 10.0  # drag over spring beyond which a pilot cannot have steps that fine all along
MOST_STIFF_STEPS = 20_000
MOST_PARTS = 16  # of a step, for the truth beside it
MOST_STEPS = 4_000_000  # of a truth: a million radians


def bounded(predict: Callable[[], float]) -> float:
    """Return a predicted error, inf where the prediction runs beyond all numbers."""
    with np.errstate(all="ignore"):
        try:
            error = predict()
        except (OverflowError, ZeroDivisionError):
            return math.inf
    return math.inf if math.isnan(error) else error


def predicted_by_pilot(
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
    integrator : Integrator
        Whose error is asked for.
    solver : Integrator
        Strang splitting, which makes the truth.
    problem : Problem
    step_s, seconds : float
        Of the run that is planned, s.
    pilots : int
        How many at most; see Notes.
    of_velocity : bool
        Of the velocity, over the amplitude times the angular frequency.

    Notes
    -----
    The motion is run from start to end at the planned step h or, where that is finer, at a quarter of a radian, H.
    The truth beside it is Strang splitting in steps of at most H and of half as much, extrapolated to none. The largest
    difference counts by :math:`(h/H)^p` with the method's order p. A pilot of the whole motion costs a few steps a
    radian, and holds whatever adds up along it: the phase, the pace of a cubic spring, the stop.

    A method's own frequency and damping add up too. Where a pilot errs by more than a tenth of the amplitude it no
    longer follows the power law, and one of a quarter of its step is made, down to the planned step itself.

    What a pilot in another step cannot hold is a resonance of the planned one; for Strang splitting it is added. The
    error of a method that does not locate turning points scatters with where in a step they lie: there the largest of
    three pilots counts, and each turning point adds friction times step to the velocity, with a sign that scatters.
    """
    if problem.amplitude_m() == 0.0:
        return 0.0
    problem = in_own_units(problem)
    start, omega = problem.amplitude_m(), problem.equation.angular_frequency_per_s
    fine = fine_step(problem)
    pilot = max(step_s, min(fine, seconds / 4.0)) if integrator.order else min(fine, seconds / 4.0)
    kinked, plain = problem.equation.is_kinked, integrator is not solver and integrator.order > 0
    # The kink of drag at a turning point keeps a high order from what its power promises.
    order = min(integrator.order, 3) if kinked else integrator.order
    if plain and omega * pilot * MOST_STIFF_STEPS < 2.0 * math.pi:
        return math.inf  # far too stiff for a method with a limit
    if fine * omega < FINE / STIFF and pilot < seconds / MOST_STIFF_STEPS:
        pilot, order = seconds / MOST_STIFF_STEPS, min(order, 1)
    # With friction no step of the truth is longer than a radian until the bob is held, and to find where it turns costs
    # as much as a dozen steps, twice a cycle.
    held = stopping_time(start, *problem.equation.laws())
    radians = omega * min(seconds, held) if problem.equation.friction_m_per_s2 else 0.0
    while True:
        parts = min(math.ceil(pilot / fine * (1.0 - 1e-12)), MOST_PARTS)
        if max(seconds / pilot * parts, 8.0 * radians) > MOST_STEPS:
            return math.inf  # so coarse, or so long, that to see its error takes seconds
        shares = PLAIN_SHARES[:pilots] if plain and kinked and pilot > step_s else (1.0,)
        # inf where the planned step is so coarse that a hardening spring throws even the truth beside it away.
        errors = [
            _largest_errors(integrator, solver, problem, each * pilot, parts, seconds)[of_velocity] / start
            for each in shares
        ]
        if not plain or max(errors) <= FAR or pilot <= step_s:
            break
        pilot = max(step_s, 0.25 * pilot)
    error = max(error * (step_s / (share * pilot)) ** order for error, share in zip(errors, shares, strict=True))
    if plain and pilot > step_s:
        error += scatter(problem, step_s, seconds)
    return error + resonance(problem, step_s, seconds) if integrator is solver else error


@functools.lru_cache(maxsize=8)
def in_own_units(problem: Problem) -> Problem:
    """Return the problem in units of its amplitude: the same object for the same, so that its truth is remembered."""
    return problem.scaled()[0]


def scatter(problem: Problem, step_s: float, seconds: float) -> float:
    """Return what friction adds where turning points are not located: force times step each, of any sign."""
    eq = problem.equation
    turns = 1.0 + eq.angular_frequency_per_s * seconds / math.pi
    force = eq.friction_m_per_s2 / (eq.angular_frequency_per_s * problem.amplitude_m())
    return float(force * step_s * math.sqrt(turns))


@functools.lru_cache(maxsize=8)
def resonance(problem: Problem, step_s: float, seconds: float) -> float:
    """Return the most that quadratic drag in kicks adds up where N steps make a cycle, N next to an even number.

    The kicks see the harmonics of |sin| sin, 8 / (pi k (k^2 - 4)) for odd k. Those next to N act as the first one does:
    they turn the phase by up to 8 / (pi N^3) of the drag, for as long as they stay in step and the drag lasts. Next to
    2 N and so on too. From a start at rest they begin as a sine of how far they are out of step, of which nothing comes
    where N is even. A cubic spring changes N as the amplitude falls, by an even number too: there they are in step for
    a time that goes as the root of how fast N changes. Where turning points are located, with friction, there is no
    such harmonic.
    """
    eq, start = problem.equation, problem.amplitude_m()
    if eq.friction_m_per_s2 or not eq.drag_per_m:
        return 0.0
    square = eq.angular_frequency_per_s**2 - eq.gamma_per_s**2
    bend = 0.75 * eq.cubic_per_m2_s2 * start * start
    fall = eq.gamma_per_s + eq.laws()[1] * start
    if square <= 0.0 or square + bend <= 0.0 or fall == 0.0:
        return 0.0
    pace, last = math.sqrt(square + bend), math.sqrt(square)
    from_rest = problem.velocity_m_per_s == 0.0 and not bend
    harmonics = []
    for multiple in (1.0, 2.0, 3.0):
        steps = multiple * 2.0 * math.pi / (pace * step_s)
        later = steps * pace / last
        even = 2.0 * round(0.5 * steps)
        off = max(abs(steps - even), 1e-12)
        slips = 2.0 * fall / pace * abs(steps - later)
        passing = math.sqrt(2.0 * math.pi / slips) if slips else math.inf
        longest = passing if (steps - even) * (later - even) <= 0.0 else min(passing, 2.0 / off)
        harmonics.append((8.0 / (math.pi * steps * steps * steps), off, longest))
    most, t, next_t = 0.0, 0.0, 0.1 / fall
    for _ in range(LOOKS):
        t, next_t = min(seconds, next_t), 2.0 * next_t
        turned = 0.0
        for size, off, longest in harmonics:
            if from_rest:
                turned += size * (1.0 - math.cos(min(off * pace * t, math.pi))) / off
            else:
                turned += size * min(pace * t, longest)
        # What is left of the amplitude then, and the root of it for the drag on the way.
        most = max(most, turned / (1.0 + fall * t) ** 1.5)
        if t == seconds:
            break
    return float(most * eq.drag_per_m * start)


def fine_step(problem: Problem) -> float:
    """Return the step at which Strang's error follows its power law, s."""
    eq, start = problem.equation, problem.amplitude_m()
    hard = math.sqrt(eq.angular_frequency_per_s**2 + 3.0 * max(eq.cubic_per_m2_s2, 0.0) * start * start)
    return float(FINE / (hard + eq.gamma_per_s + 2.0 * eq.drag_per_m * hard * start))


@functools.lru_cache(maxsize=8)
def _largest_errors(
    integrator: Integrator, solver: Integrator, problem: Problem, pilot: float, parts: int, seconds: float
) -> tuple[float, float]:
    """Return the largest errors of displacement, and of velocity over the angular frequency, of a run, m."""
    try:
        found, truth = compared(integrator, solver, problem, pilot, parts, seconds)
    except DynamicsError:
        return math.inf, math.inf  # it ran away: that is its error
    off = found - truth
    return _peak(np.abs(off.real)), _peak(np.abs(off.imag))


def compared(
    integrator: Integrator, solver: Integrator, problem: Problem, step_s: float, parts: int, seconds: float
) -> tuple[C16, C16]:
    """Return the states of a method and the true ones (n,): displacement, and velocity over the angular frequency.

    Raises
    ------
    DynamicsError
        If one of them ran away.
    """
    coarse, truth = _truth(solver, problem, step_s, parts, seconds)
    if integrator is solver and coarse is not None:
        return coarse, truth
    return _states(integrator, problem, step_s, len(truth) - 1, 1), truth


def _states(integrator: Integrator, problem: Problem, step_s: float, steps: int, every: int) -> C16:
    """Displacement, and velocity over the angular frequency as the imaginary part."""
    run = integrator.run(problem, step_s, steps, every=every)
    return run.y + 1j * (run.v / problem.equation.angular_frequency_per_s)


def _peak(error: F8) -> float:
    """Return the largest of a sampled curve: the top of the parabola through its largest samples."""
    top = int(np.argmax(error))
    if not 0 < top < len(error) - 1:
        return float(error[top])
    before, most, after = error[top - 1 : top + 2].tolist()
    bend = before - 2.0 * most + after
    return float(most - 0.125 * (after - before) ** 2 / bend if bend < 0.0 else most)


@functools.lru_cache(maxsize=16)
def _truth(solver: Integrator, problem: Problem, pilot: float, parts: int, seconds: float) -> tuple[C16 | None, C16]:
    """Return the states in steps of the pilot, if these are fine, and the extrapolated ones at the same times.

    Remembered, as every finer step and the next method ask for it again.
    """
    steps = max(1, round(seconds / pilot))
    once, twice = (_states(solver, problem, pilot / k, steps * k, k) for k in (parts, 2 * parts))
    return once if parts == 1 else None, twice + (twice - once) / 3.0
