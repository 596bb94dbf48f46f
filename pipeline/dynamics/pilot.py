"""A pilot run: what a period at several amplitudes shows of a method's error, carried along the whole motion."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pipeline.dynamics.averaged import amplitude
from pipeline.dynamics.equation import Problem
from pipeline.track import F8

if TYPE_CHECKING:
    from pipeline.dynamics.integrator import Integrator

__all__ = ["predicted_by_pilot"]

STEPS_A_PERIOD = 64
MOST_STEPS, LEAST_STEPS = 1000, 24
NODES = 8  # amplitudes, each half of the one before
REFINED = 4
POINTS = 240
CUBIC_DOUBT = 1.5
CUBIC_PERIODS = 5  # a period that depends on amplitude does not end where it began: over several that matters less


def predicted_by_pilot(
    integrator: Integrator, truth: Integrator, problem: Problem, step_s: float, seconds: float
) -> float:
    """Return the expected largest error of the displacement over the starting amplitude.

    Parameters
    ----------
    integrator : Integrator
        Whose error is asked for.
    truth : Integrator
        What it is compared with, at a quarter of the step.
    problem : Problem
        Of one trajectory.
    step_s, seconds : float
        Of the run that is planned, s.

    Notes
    -----
    From the start a first stretch is run twice; their difference is the error within a cycle. Then, at amplitudes of a
    half, a quarter and so on, the relative error :math:`\\delta + i\\varphi` that a cycle adds to amplitude and phase
    is measured. Along the averaged amplitude :math:`A(t)` they add up to
    :math:`\\dot\\varphi = \\varphi' + 3cA\\,\\delta A/4\\omega` and
    :math:`\\dot{\\delta A} = A\\delta' - (\\gamma + 2\\beta A)\\,\\delta A`. A step finer than the pilot's counts
    by the method's order.
    """
    start = problem.amplitude_m()
    if start == 0.0:
        return 0.0
    problem, _ = problem.scaled()
    start = problem.amplitude_m()
    eq = problem.equation
    period = 2.0 * math.pi / eq.angular_frequency_per_s
    step, finer = _pilot_step(integrator, problem, step_s, min(seconds, period))
    # The kink of drag at a turning point keeps a high order from what its power promises.
    share = finer ** min(integrator.order, 3) / (1.0 - float(REFINED) ** -integrator.order if integrator.order else 1.0)
    if period / step > 20 * MOST_STEPS:
        return math.inf  # far too stiff for a method with a limit
    stretch = min(max(round(min(seconds, 1.5 * period) / step), LEAST_STEPS), max(1, round(seconds / step)))
    coarse, fine = _both(integrator, truth, problem, step, stretch)
    early = share * float(np.max(np.abs(coarse.real - fine.real))) / start
    if seconds <= 1.5 * period or eq.gamma_per_s > 0.9 * eq.angular_frequency_per_s:
        return float(early)
    carried = share * _carried(problem, _defects(integrator, truth, problem, step), seconds) / start
    # With a cubic spring an error of amplitude is one of pace too, of another size for every start.
    return float(early + (CUBIC_DOUBT if eq.cubic_per_m2_s2 else 1.0) * carried)


def _pilot_step(integrator: Integrator, problem: Problem, step_s: float, period: float) -> tuple[float, float]:
    """Return the pilot's step, s, and how much finer the planned one is."""
    eq = problem.equation
    fastest = max(abs(problem.velocity_m_per_s), eq.angular_frequency_per_s * problem.amplitude_m())
    wanted = min(
        2.0 * math.pi / eq.angular_frequency_per_s / STEPS_A_PERIOD, 0.2 / max(eq.drag_per_m * fastest, 1e-300)
    )
    wanted = min(max(wanted, period / MOST_STEPS), 0.5 * integrator.stable_step(problem))
    if not integrator.order:
        return wanted, 1.0
    return (step_s, 1.0) if step_s >= wanted else (wanted, step_s / wanted)


def _both(integrator: Integrator, truth: Integrator, problem: Problem, step: float, steps: int) -> tuple[F8, F8]:
    """Return displacement and, as imaginary part, velocity over frequency, of method and truth."""
    omega = problem.equation.angular_frequency_per_s
    runs = (
        integrator.run(problem, step, steps),
        truth.run(problem, step / REFINED, steps * REFINED, every=REFINED),
    )
    first, second = (run.y + 1j * run.v / omega for run in runs)
    return first, second


def _defects(integrator: Integrator, truth: Integrator, problem: Problem, step: float) -> tuple[F8, F8]:
    """Return amplitudes, rising, and what a second adds to amplitude (real) and phase (imaginary) there."""
    eq = problem.equation
    steps = max(round(2.0 * math.pi / eq.angular_frequency_per_s / step), LEAST_STEPS)
    if eq.cubic_per_m2_s2:
        steps *= CUBIC_PERIODS
    sizes, rates = [], []
    for node in range(NODES):
        share = 0.5**node
        size = problem.amplitude_m() * share
        # Where in its turn a motion starts sets the energy that a step believes in, and with it a cubic spring's pace.
        starts = [Problem(eq, size, 0.0)]
        if eq.cubic_per_m2_s2:
            starts.append(Problem(eq, problem.displacement_m * share, problem.velocity_m_per_s * share))
        if any(integrator.refusal(one) for one in starts):
            break  # so near to the stop that the smallest node so far stands for the rest
        found = []
        for one in starts:
            coarse, fine = _both(integrator, truth, one, step, steps)
            if abs(fine[-1]) > 0.0 and abs(coarse[-1]) > 0.0:
                found.append(np.log(coarse[-1] / fine[-1]) / (steps * step))
        if found:
            sizes.append(size)
            rates.append(max((r.real for r in found), key=abs) + 1j * max((r.imag for r in found), key=abs))
    return np.array(sizes[::-1]), np.array(rates[::-1])


def _carried(problem: Problem, defects: tuple[F8, F8], seconds: float) -> float:
    """Return the largest error, m, that the defects add up to."""
    sizes, rates = defects
    if not sizes.size:
        return 0.0
    eq = problem.equation
    gamma, beta, mu = eq.laws()
    bend = 0.75 * eq.cubic_per_m2_s2 / eq.angular_frequency_per_s
    t = np.linspace(0.0, seconds, POINTS)
    size = amplitude(problem.amplitude_m(), gamma, beta, mu, t)
    # Beyond the smallest node quadratic drag fades, and with it what it adds.
    grow = np.interp(size, sizes, rates.real)
    turn = np.interp(size, sizes, rates.imag)
    off, phase, worst = 0.0, 0.0, 0.0
    for i in range(POINTS):
        worst = max(worst, math.hypot(off, size[i] * phase))
        phase += t[1] * (turn[i] + bend * size[i] * off)
        shrink = gamma + 2.0 * beta * size[i]
        off = (off + t[1] * size[i] * grow[i]) / (1.0 + t[1] * shrink)
    return worst
