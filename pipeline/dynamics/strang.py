"""The exact flow of the linear oscillator, and Strang splitting: half a step of it, one of the drag, another half.

The flow is accurate for any damping; scipy.linalg.expm takes 30 times as long and loses four digits at gamma = 1000
omega. The splitting is here because drag is weak and the oscillation fast: at equal error it takes a hundredth of the
time of scipy's DOP853 (``python benchmarks/dynamics.py``). Spring and viscous drag are advanced by their exact flow, so
that a linear scene is solved exactly in steps of any length. The flow of quadratic drag is exact too, :math:`v/(1 +
b|v|h)`, and cannot overflow. A cubic term gives half a kick before and after it. Between turning points friction is a
constant force, which shifts the rest position of the oscillator. Turning points are located; there the bob sticks if
the pull of the spring is not greater than the friction. (G. Strang, SIAM J. Numer. Anal. 5 (1968) 506,
doi:10.1137/0705041.)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.dynamics.equation import Equation, Problem
from pipeline.dynamics.integrator import MOST_STEPS, Integrator, kept
from pipeline.errors import DynamicsError
from pipeline.track import F8

Entries = tuple[float, float, float, float]  # of the matrix (a, b; c, d) that advances displacement and velocity


def flow(omega: float, gamma: float, t: Any, of: Any = math) -> Any:
    """Return the entries of the matrix of :math:`\\ddot y = -\\omega^2 y - 2\\gamma\\dot y` over a time t in s.

    The matrix is :math:`e^{-\\gamma t}(C + \\gamma S,\\ S;\\ -\\omega^2 S,\\ C - \\gamma S)`. Below critical damping
    :math:`C = \\cos(\\omega_d t)` and :math:`S = \\sin(\\omega_d t)/\\omega_d`. Above it, the entries use
    :math:`\\kappa = \\sqrt{(\\gamma-\\omega)(\\gamma+\\omega)}`, the fast rate :math:`\\gamma + \\kappa` and the slow
    rate :math:`\\omega^2/(\\gamma+\\kappa)`, without differences of nearly equal numbers. A drive has
    :math:`\\gamma < 0`; if it is that strong, the slow rate is :math:`\\gamma - \\kappa`. The functions are those of
    ``math``, twenty times as fast for a single time, or with ``of=np`` those for an array of times.
    """
    if abs(gamma) < omega:
        damped = math.sqrt((omega - gamma) * (omega + gamma))
        shrink = of.exp(-gamma * t)
        cosine, b = shrink * of.cos(damped * t), shrink * of.sin(damped * t) / damped
        return cosine + gamma * b, b, -omega * omega * b, cosine - gamma * b
    kappa = math.sqrt((gamma - omega) * (gamma + omega))
    larger = gamma + math.copysign(kappa, gamma)
    smaller = omega * (omega / larger)
    fast, slow = (larger, smaller) if gamma > 0.0 else (smaller, larger)
    late, soon = of.exp(-slow * t), of.exp(-fast * t)
    b = late * (t if kappa == 0.0 else -of.expm1(-2.0 * kappa * t) / (2.0 * kappa))
    middle = 0.5 * (late + soon)
    d = (fast * soon - slow * late) / (2.0 * kappa) if kappa > 0.5 * abs(gamma) else middle - gamma * b
    return middle + gamma * b, b, -omega * omega * b, d


@dataclass(frozen=True, slots=True)
class Exact(Integrator):
    """Integrator that evaluates the linear oscillator's solution at each time, so that no rounding accumulates."""

    name: str = "exact"
    words: str = "the exact propagator"
    order: int = 0

    def refusal(self, problem: Problem) -> str:
        """Return the reason for refusal if any force other than spring and viscous drag acts; empty otherwise."""
        if problem.equation.is_linear:
            return ""
        return "it knows spring and viscous drag only, this scene has more"

    def march(self, problem: Problem, step_s: float, steps: int, every: int) -> tuple[F8, F8]:
        """Evaluate the solution at every kept time."""
        t = step_s * every * np.arange(steps // every + 1.0)
        a, b, c, d = flow(problem.equation.angular_frequency_per_s, problem.equation.gamma_per_s, t, np)
        y, v = problem.displacement_m, problem.velocity_m_per_s
        return a * y + b * v, c * y + d * v


EXACT = Exact()


Stepper = Callable[[float, float, int, float, Entries], tuple[float, float]]


@dataclass(frozen=True, slots=True)
class Strang(Integrator):
    """Strang splitting."""

    name: str = "strang"
    words: str = "Strang splitting with exact sub-flows"
    order: int = 2

    def stable_step(self, problem: Problem) -> float:
        """Return inf, as neither sub-flow adds energy; with a cubic term, whose kicks can, return its limit in s."""
        eq = problem.equation
        if not eq.cubic_per_m2_s2:
            return math.inf
        added = 3.0 * abs(eq.cubic_per_m2_s2) * problem.amplitude_m() ** 2
        return 1.0 / math.sqrt(added + eq.angular_frequency_per_s**2)

    def march(self, problem: Problem, step_s: float, steps: int, every: int) -> tuple[F8, F8]:
        """Solve by splitting every step; with friction, turning points are located."""
        eq = problem.equation
        if not eq.friction_m_per_s2:
            y, v = kept(problem, _states(problem, step_s, every), steps // every)
            # The states lack the last half step of the oscillator.
            a, b, c, d = flow(eq.angular_frequency_per_s, eq.gamma_per_s, 0.5 * step_s)
            y[1:], v[1:] = a * y[1:] + b * v[1:], c * y[1:] + d * v[1:]
            return y, v
        radians = eq.angular_frequency_per_s * step_s
        if radians * steps > MOST_STEPS:
            raise DynamicsError(
                f"strang with friction turns by {radians * steps:.3g} radians", "take a shorter step or run"
            )
        parts = max(1, math.ceil(radians))  # so that a step contains at most one turning point
        return kept(problem, _rubbing(problem, step_s / parts, every * parts), steps // every)


def _states(problem: Problem, h: float, every: int) -> Iterator[float]:
    """Yield displacement and velocity after the drag of every ``every``-th step, before its last half step.

    Half steps of neighbours are combined into whole ones, which halves the time.
    """
    eq, y, v = problem.equation, problem.displacement_m, problem.velocity_m_per_s
    a, b, c, d = flow(eq.angular_frequency_per_s, eq.gamma_per_s, 0.5 * h)
    y, v = a * y + b * v, c * y + d * v
    a, b, c, d = flow(eq.angular_frequency_per_s, eq.gamma_per_s, h)
    slow, kick, done = eq.drag_per_m * h, 0.5 * h * eq.cubic_per_m2_s2, 0
    while True:
        push = kick * y * y * y if kick else 0.0
        v -= push
        v = (v / (1.0 + slow * v) if v > 0.0 else v / (1.0 - slow * v)) - push
        done += 1
        if done == every:
            yield y
            yield v
            done = 0
        y, v = a * y + b * v, c * y + d * v


def _rubbing(problem: Problem, h: float, every: int) -> Iterator[float]:
    """Yield displacement and velocity after every ``every``-th step of a bob with friction, which may come to rest."""
    eq, y, v = problem.equation, problem.displacement_m, problem.velocity_m_per_s
    step, half, way = _stepper(eq), _half(eq, h), eq.direction(y, v)
    while True:
        for _ in range(every):
            if not way:
                break
            y1, v1 = step(y, v, way, h, half)
            if v1 * way <= 0.0:
                turns = _turning(step, eq, y, v, v1, way, h)
                y1, v1 = step(y, v, way, turns, _half(eq, turns))[0], 0.0
                way = eq.direction(y1, 0.0)
                if way and turns < h:
                    y1, v1 = step(y1, 0.0, way, h - turns, _half(eq, h - turns))
            y, v = y1, v1
        yield y
        yield v


def _half(eq: Equation, h: float) -> Entries:
    entries: Entries = flow(eq.angular_frequency_per_s, eq.gamma_per_s, 0.5 * h)
    return entries


def _stepper(eq: Equation) -> Stepper:
    """Return a step in one direction: of y, v, that direction, the step h, and the oscillator's flow over h / 2."""
    shift, drag, cubic = eq.friction_m_per_s2 / eq.angular_frequency_per_s**2, eq.drag_per_m, eq.cubic_per_m2_s2

    def step(y: float, v: float, way: int, h: float, half: Entries) -> tuple[float, float]:
        a, b, c, d = half
        rest = -way * shift
        y -= rest
        y, v = a * y + b * v, c * y + d * v
        push = 0.5 * h * cubic * (y + rest) ** 3 if cubic else 0.0
        v -= push
        v = v / (1.0 + drag * h * abs(v)) - push
        return a * y + b * v + rest, c * y + d * v

    return step


def _turning(step: Stepper, eq: Equation, y: float, v: float, after: float, way: int, h: float) -> float:
    """Return the time within a step h at which the velocity, v before and ``after`` it, is zero, by Newton's method."""
    t = h * v / (v - after) if v != after else 0.5 * h
    for _ in range(2):  # each squares the error of the chord
        y1, v1 = step(y, v, way, t, _half(eq, t))
        slope = -eq.spring(y1) - way * eq.friction_m_per_s2
        t = min(max(t - v1 / slope, 0.0), h) if slope else t
    return t


STRANG = Strang()
