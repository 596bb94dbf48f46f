"""The Taylor series of a motion, step by step from turning point to turning point.

References
----------
.. [1] A. Jorba, M. Zou, Exp. Math. 14 (2005) 99, doi:10.1080/10586458.2005.10128904.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from operator import mul

from pipeline.dynamics.equation import Equation
from pipeline.dynamics.prediction.left_out import Piece
from pipeline.dynamics.problem import Problem

__all__ = ["fastest", "local_error", "pieces", "polynomial", "terms_of"]


def fastest(problem: Problem) -> float:
    """Return the frequency of a spring as hard as it gets, 1/s."""
    eq = problem.equation
    start = problem.amplitude_m()
    return math.sqrt(eq.angular_frequency_per_s**2 + 3.0 * max(eq.cubic_per_m2_s2, 0.0) * start * start)


def local_error(problem: Problem, seconds: float, tolerance: float) -> float:
    """Return what a step may err, over the size of the motion, so that all of them keep the tolerance."""
    eq, start = problem.equation, problem.amplitude_m()
    reach = start / eq.angular_frequency_per_s
    # Under a cubic spring an error of the amplitude shifts the frequency, and the phase for all the time that is left.
    bend = 0.75 * abs(eq.cubic_per_m2_s2) * reach * reach
    radians = fastest(problem) * seconds
    drifts = 1.0 + bend / (1.0 + bend) * radians if bend < math.inf else 1.0 + radians
    return max(tolerance / (1.0 + radians) / drifts, 1e-18)


def terms_of(local: float, longest: float) -> int:
    """Return the number of terms that keep a local error in steps of some radians."""
    return next(p for p in range(6, 60) if longest**p / math.factorial(p) < local)


def pieces(problem: Problem, local: float, longest: float, *, spare: bool = False) -> Iterator[Piece]:
    """Yield one step after the other, without end.

    Parameters
    ----------
    problem : Problem
    local : float
        What a step may err, over the size of the motion.
    longest : float
        Radians a step.
    spare : bool
        Whether to say what the first terms left out come to.
    """
    eq = problem.equation
    y, v = problem.displacement_m, problem.velocity_m_per_s
    fast, order, kinked = fastest(problem), terms_of(local, longest), eq.is_kinked
    lacks = (0.0, 0.0)
    while True:
        way = eq.direction(y, v) if kinked else 1
        if way == 0:
            yield Piece([y], [0.0], 1.0, math.inf, (y, 0.0))
            return
        unit = min(1.0 / fast, 0.5 / eq.gamma_per_s if eq.gamma_per_s else math.inf)
        # The drag's own time shrinks with speed; where friction is strong it is the speed within the step.
        braked = eq.drag_per_m * (abs(v) + abs(y) * fast)
        if braked:
            unit = min(unit, 1.0 / braked)
        ys, vs = _series(eq, way, y, v, unit, order + spare)
        next_y, next_v = (ys.pop(), vs.pop()) if spare else (0.0, 0.0)
        size = max(abs(y), abs(v) / fast, abs(ys[2]))
        h = min(_step(ys, vs, size, local, unit * fast), longest / (unit * fast))
        end = polynomial(vs, h)
        turned = kinked and end * way <= 0.0
        if turned:
            h = _root(vs, h, way)
        y, v = polynomial(ys, h), 0.0 if turned else polynomial(vs, h)
        if spare:
            lacks = next_y * h ** (order + 1), next_v * h ** (order + 1)
        yield Piece(ys, vs, unit, h * unit, (y, v), lacks)


def _series(eq: Equation, way: int, y: float, v: float, unit: float, order: int) -> tuple[list[float], list[float]]:
    """Return the coefficients of displacement and velocity in powers of t / unit."""
    stiffness, viscous = eq.angular_frequency_per_s**2, 2.0 * eq.gamma_per_s
    drag, cubic = way * eq.drag_per_m, eq.cubic_per_m2_s2
    ys, vs, squares = [y], [v], [y * y]
    force = way * eq.friction_m_per_s2
    for k in range(order):
        change = -stiffness * ys[k] - viscous * vs[k] - force
        force = 0.0
        if drag:
            change -= drag * sum(map(mul, vs, reversed(vs)))
        if cubic:
            change -= cubic * sum(map(mul, squares, reversed(ys)))
        ys.append(unit * vs[k] / (k + 1))
        vs.append(unit * change / (k + 1))
        if cubic:
            squares.append(sum(map(mul, ys, reversed(ys))))
    return ys, vs


def _step(ys: list[float], vs: list[float], size: float, local: float, radians: float) -> float:
    """Return the step, in units, at which the last terms fall to the local tolerance."""
    longest = math.inf
    for back in (1, 2):
        # Displacement and velocity over the same size: velocity per radian of the unit.
        last = max(abs(ys[-back]), abs(vs[-back]) * radians)
        if last > 0.0:
            longest = min(longest, (local * size / last) ** (1.0 / (len(ys) - back)))
    return longest


def polynomial(coefficients: list[float], x: float) -> float:
    """Return the value of a polynomial, its coefficients from the constant on."""
    value = 0.0
    for c in reversed(coefficients):
        value = value * x + c
    return value


def _root(vs: list[float], h: float, way: int) -> float:
    """Return where in (0, h] the velocity leaves its sign."""
    slopes = [k * c for k, c in enumerate(vs)][1:]
    low, high = 0.0, h
    x = h
    for _ in range(60):
        value = polynomial(vs, x)
        low, high = (x, high) if value * way > 0.0 else (low, x)
        slope = polynomial(slopes, x)
        better = x - value / slope if slope else low
        if not low < better < high:
            better = 0.5 * (low + high)
        if abs(better - x) <= 1e-16 * h:
            return better
        x = better
    return x
