"""Strang splitting with exact sub-flows: half an oscillator, all of the quadratic drag, half an oscillator.

By hand, as it takes a hundredth of the time of scipy's LSODA at equal error: 2.5 ms against 600 for two minutes at 1e-6
(``python benchmarks/dynamics.py``).

The linear part, spring and viscous drag, moves by its own exact flow, so that no step is unstable and a linear scene
is exact. Quadratic drag has an exact flow too, :math:`v/(1 + b|v|h)`, which no speed can overflow. Between turning
points friction is a constant force: it shifts the rest position of the oscillator. The turning points themselves are
located; there the bob sticks where the spring pulls with less than friction holds.

References
----------
.. [1] G. Strang, SIAM J. Numer. Anal. 5 (1968) 506, doi:10.1137/0705041.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.dynamics.equation import Real
from pipeline.dynamics.flow import flow
from pipeline.dynamics.integrator import Trajectory, integrate
from pipeline.dynamics.integrators.turning import Friction
from pipeline.dynamics.pilot import predicted_by_pilot
from pipeline.dynamics.predict import rounding_error, worst_error
from pipeline.dynamics.problem import Problem
from pipeline.errors import DynamicsError
from pipeline.track import F8

__all__ = ["STRANG", "Strang"]


SHORT = 1e-3  # radians: between nearer displacements the velocity would be lost in rounding
LONGEST_WITH_FRICTION = 1e6  # radians a step
MOST_KEPT = 4_000_000  # states between those asked for that may be held meanwhile


@dataclass(frozen=True, slots=True)
class Strang:
    """Strang splitting."""

    name: str = "strang"
    words: str = "Strang splitting with exact sub-flows"
    order: int = 2

    def refusal(self, problem: Problem) -> str:  # noqa: ARG002 - every integrator has the same signature
        """Return nothing: it takes every problem."""
        return ""

    def run(self, problem: Problem, step_s: float, steps: int, *, every: int = 1) -> Trajectory:
        """Solve a problem; see :class:`Integrator`."""
        together = None if problem.equation.has_friction else _march_ensemble
        return integrate(self, problem, step_s, steps, every, _march, together)

    def stable_step(self, problem: Problem) -> float:
        """Return inf, as both sub-flows only lose energy; with a cubic term, whose kick can add some, its limit, s."""
        eq = problem.equation
        if not np.any(eq.cubic_per_m2_s2):
            return math.inf
        with np.errstate(over="ignore"):
            added = 3.0 * np.square(np.sqrt(np.abs(eq.cubic_per_m2_s2)) * problem.amplitude_m())
        return float(np.min(1.0 / np.sqrt(added + eq.angular_frequency_per_s**2)))

    def predicted_error(self, problem: Problem, step_s: float, seconds: float) -> float:
        """Return what a pilot run in coarser steps shows, and the rounding."""

        def of(one: Problem) -> float:
            rounding = rounding_error(one, seconds, seconds / step_s)
            splitting = 0.0 if one.equation.is_linear else predicted_by_pilot(self, self, one, step_s, seconds)
            return rounding + splitting

        return worst_error(problem, step_s, seconds, of)


def _march(problem: Problem, step_s: float, steps: int, every: int) -> tuple[F8, F8]:
    eq = problem.equation
    if eq.has_friction:
        return _march_with_friction(problem, step_s, steps, every)
    _, b, _, _ = flow(eq.angular_frequency_per_s, eq.gamma_per_s, step_s)
    short = b * eq.angular_frequency_per_s < SHORT or b < 0.1 * step_s
    if not (short or (every > 1 and steps > MOST_KEPT)):
        y, v = _march_one(problem, step_s, steps)
        return y[::every].copy(), v[::every].copy()
    return _march_kicked(problem, step_s, steps, every)


def _march_one(problem: Problem, h: float, steps: int) -> tuple[F8, F8]:
    """Join the half steps of neighbours into whole ones, and keep only the displacement before each: half the time.

    With the velocity in units that make the matrix's second entry 1 a step has three products; two displacements in a
    row tell the velocity between them afterwards, and what is kept is turned by the missing half at once. A cubic
    force is a kick before and after the drag.
    """
    eq = problem.equation
    half = flow(eq.angular_frequency_per_s, eq.gamma_per_s, 0.5 * h)
    a, b, c, d = flow(eq.angular_frequency_per_s, eq.gamma_per_s, h)
    slow, back, kick = eq.drag_per_m * h / b, b * c, 0.5 * h * b * eq.cubic_per_m2_s2
    y, v = _turned(half, problem.displacement_m, problem.velocity_m_per_s)
    u = b * v
    kept: list[float] = []
    keep = kept.append
    if kick:
        for _ in range(steps):
            push = kick * y * y * y
            u -= push
            u = (u / (1.0 + slow * u) if u > 0.0 else u / (1.0 - slow * u)) - push
            keep(y)
            y, u = a * y + u, back * y + d * u
    else:
        for _ in range(steps):
            u = u / (1.0 + slow * u) if u > 0.0 else u / (1.0 - slow * u)
            keep(y)
            y, u = a * y + u, back * y + d * u
    keep(y)
    found: F8 = np.frombuffer(array("d", kept))
    return _with_start(problem, *_turned(half, found[:-1], (found[1:] - a * found[:-1]) / b))


def _march_kicked(problem: Problem, h: float, steps: int, every: int) -> tuple[F8, F8]:
    """Step with the cubic force as a kick before and after the drag, at any step and keeping any of them."""
    eq = problem.equation
    half = flow(eq.angular_frequency_per_s, eq.gamma_per_s, 0.5 * h)
    a, b, c, d = flow(eq.angular_frequency_per_s, eq.gamma_per_s, h)
    slow, kick = eq.drag_per_m * h, 0.5 * h * eq.cubic_per_m2_s2
    y, v = _turned(half, problem.displacement_m, problem.velocity_m_per_s)
    kept: list[float] = []
    keep = kept.append
    push = 0.0
    for _ in range(steps // every):
        for number in range(every, 0, -1):
            if kick:
                push = kick * y * y * y
                v -= push
            v = v / (1.0 + slow * v) if v > 0.0 else v / (1.0 - slow * v)
            v -= push
            if number == 1:
                keep(y)
                keep(v)
            y, v = a * y + b * v, c * y + d * v
    states = np.frombuffer(array("d", kept)).reshape(-1, 2)
    return _with_start(problem, *_turned(half, states[:, 0], states[:, 1]))


def _march_ensemble(problem: Problem, h: float, steps: int, every: int) -> tuple[F8, F8]:
    """Every member at once, in place: no array is made within a step."""
    eq = problem.equation
    rates = list(zip(eq.angular_frequency_per_s.tolist(), eq.gamma_per_s.tolist(), strict=True))
    half, (a, b, c, d) = (np.array([flow(*each, t) for each in rates]).T.copy() for t in (0.5 * h, h))
    slow, kick = eq.drag_per_m * h, 0.5 * h * eq.cubic_per_m2_s2
    with_cubic = bool(np.any(kick))
    ys = np.empty((steps // every, problem.size))
    vs = np.empty_like(ys)
    y, v = _turned(half, problem.displacement_m, problem.velocity_m_per_s)
    one, other, push = np.empty_like(y), np.empty_like(y), np.empty_like(y)
    for number in range(1, steps + 1):
        if with_cubic:
            np.multiply(y, y, out=push)
            push *= y
            push *= kick
            v -= push
        np.abs(v, out=one)
        one *= slow
        one += 1.0
        v /= one
        if with_cubic:
            v -= push
        if number % every == 0:
            ys[number // every - 1], vs[number // every - 1] = y, v
        np.multiply(b, v, out=one)
        np.multiply(c, y, out=other)
        y *= a
        y += one
        v *= d
        v += other
    return _with_start(problem, *_turned(half, ys, vs))


def _march_with_friction(problem: Problem, h: float, steps: int, every: int) -> tuple[F8, F8]:
    # Within a step a bob may turn once: no step longer than a radian.
    radians = problem.equation.angular_frequency_per_s * h
    if radians > LONGEST_WITH_FRICTION:
        raise DynamicsError(
            f"with friction a step of strang is at most {LONGEST_WITH_FRICTION:g} radians, as each of them is looked "
            f"at for turning points, got {radians:.3g}; take a shorter step"
        )
    parts = max(1, math.ceil(radians))
    states = Friction(problem, h / parts).run(steps * parts)[every * parts - 1 :: every * parts]
    return _with_start(problem, states[:, 0], states[:, 1])


def _turned(matrix: Sequence[Real] | F8, y: Real, v: Real) -> tuple[Real, Real]:
    a, b, c, d = matrix
    return a * y + b * v, c * y + d * v


def _with_start(problem: Problem, y: F8, v: F8) -> tuple[F8, F8]:
    return (
        np.concatenate([np.asarray(problem.displacement_m)[None], y]),
        np.concatenate([np.asarray(problem.velocity_m_per_s)[None], v]),
    )


STRANG = Strang()
