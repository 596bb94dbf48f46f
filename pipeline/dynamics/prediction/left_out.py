"""What the terms that a Taylor series leaves out make of a whole run."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from pipeline.dynamics.equation import Equation
from pipeline.dynamics.flow import flow
from pipeline.dynamics.prediction.envelope import frequency, pace_and_shear
from pipeline.dynamics.prediction.growth import Rates, grown, levels, slow_from
from pipeline.dynamics.prediction.rounding import expected_rounding, sheared_rounding
from pipeline.dynamics.problem import Problem

__all__ = ["Piece", "left_out"]

MOST_LOOKS = 400  # steps from which an error is told
STRONG = 0.3  # drag over spring at the starting amplitude from which errors die out as fast
CYCLES = 2  # from which the error of all is told
SCATTERS = 4.0  # of the relative rounding, times the root of the phase: what many sums leave


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """One step.

    Parameters
    ----------
    ys, vs : list of float
        The series in powers of t / unit.
    unit, long : float
        s; inf long where friction holds the bob.
    end : tuple of float
        Displacement and velocity where the next piece starts.
    lacks : tuple of float
        The first terms left out, there.
    """

    ys: list[float]
    vs: list[float]
    unit: float
    long: float
    end: tuple[float, float]
    lacks: tuple[float, float] = (0.0, 0.0)


Looks = Callable[[Problem], Iterator[Piece]]
"""A problem to the steps of its run, each with what it lacks."""


def left_out(problem: Problem, looks: Looks, spacing_s: float, seconds: float) -> tuple[float, float]:
    """Return the errors that the terms left out, and the rounding, make of a whole run.

    Parameters
    ----------
    problem : Problem
        With its own amplitude as the unit.
    looks : callable
        In the steps of the run that is planned.
    spacing_s, seconds : float
        The first time that is kept, and the last.

    Returns
    -------
    tuple of float
        Of the displacement over the starting amplitude, of the velocity over that times the angular frequency.

    Notes
    -----
    A step errs by the first terms that it leaves out. Of some cycles, the first and some at amplitudes on the way, they
    are summed as errors of energy and of time, which the averaged motion carries to the end.
    """
    start, eq = problem.amplitude_m(), problem.equation
    if start == 0.0:
        return 0.0, 0.0
    since = slow_from(problem, seconds)
    displacement, velocity = (each / start for each in _lacking(problem, looks, since, spacing_s)[0])

    def rate(level: Problem) -> tuple[float, float]:
        cycle = 2.0 * math.pi / float(frequency(eq, np.array([level.displacement_m]))[0])
        return _lacking(level, looks, CYCLES * cycle)[1]

    if since < seconds:
        rates = Rates.at(levels(problem, seconds, since), eq, rate)
        displacement += grown(problem, seconds, since, rates)
        velocity += grown(problem, seconds, since, rates, of_velocity=True)
    rounding = expected_rounding(problem, seconds, SCATTERS, 0.5) + sheared_rounding(problem, seconds)
    return displacement + rounding, velocity + rounding


def _lacking(
    problem: Problem, looks: Looks, seconds: float, first: float = 0.0
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the largest errors of displacement and of velocity per radian from a time on, and what a second adds.

    Along the motion an error is one of time, across it one of size. Another size is another pace under a cubic spring.
    """
    eq, reach = problem.equation, problem.amplitude_m()
    omega = eq.angular_frequency_per_s
    pace, shear = (float(each[0]) for each in pace_and_shear(eq, np.array([reach])))
    stiff = omega**2 + eq.cubic_per_m2_s2 * reach**2
    steps = itertools.islice(looks(problem), MOST_LOOKS)
    if eq.drag_per_m * reach > STRONG:
        return _carried(eq, problem.displacement_m, steps, seconds, first), (0.0, 0.0)
    time = of_size = of_time = 0.0
    most = 0.0, 0.0
    for piece in steps:
        if piece.long == math.inf:
            break
        (y, v), (dy, dv) = piece.end, piece.lacks
        pull = float(eq.spring(y))
        speed = v * v + pull * pull / stiff
        if speed == 0.0:
            continue
        of_time += (dy * v - dv * pull / stiff) / speed - shear * of_size * piece.long
        of_size += (v * dv + pull * dy) / (reach * reach * stiff)
        time += piece.long
        size = abs(of_size) * max(abs(y), abs(v) / omega)
        before = most if time > first else (0.0, 0.0)
        most = max(before[0], abs(of_time * v) + size), max(before[1], abs(of_time * pull / omega) + size)
        if time >= seconds * (1.0 - 1e-9):
            break
    return most, (of_size / time if time else 0.0, of_time * pace / time if time else 0.0)


def _carried(eq: Equation, y: float, steps: Iterator[Piece], seconds: float, first: float) -> tuple[float, float]:
    """Return the largest errors from a time on where drag outweighs the spring and damps them too, by its own drag."""
    omega = eq.angular_frequency_per_s
    off_y = off_v = time = 0.0
    most = 0.0, 0.0
    for piece in steps:
        if piece.long == math.inf:
            break
        drag = eq.gamma_per_s + eq.drag_per_m * abs(piece.end[0] - y) / piece.long
        a, b, c, d = flow(omega, drag, piece.long)
        off_y, off_v = a * off_y + b * off_v + piece.lacks[0], c * off_y + d * off_v + piece.lacks[1]
        y, time = piece.end[0], time + piece.long
        before = most if time > first else (0.0, 0.0)
        most = max(before[0], abs(off_y)), max(before[1], abs(off_v) / omega)
        if time >= seconds:
            break
    return most
