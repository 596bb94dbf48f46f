"""Velocity Verlet, and Yoshida's composition of three symmetric steps to order four.

References
----------
.. [1] H. Yoshida, Phys. Lett. A 150 (1990) 262, doi:10.1016/0375-9601(90)90092-3.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.dynamics.equation import Equation, Real
from pipeline.dynamics.integrator import Step
from pipeline.dynamics.integrators.one_step import OneStep, acceleration

__all__ = ["VERLET", "YOSHIDA4"]

_OUTER = 1.0 / (2.0 - 2.0 ** (1.0 / 3.0))
_WEIGHTS = (_OUTER, 1.0 - 2.0 * _OUTER, _OUTER)


def _verlet(eq: Equation, h: float) -> Step:
    a = acceleration(eq)

    def step(y: Real, v: Real) -> tuple[Real, Real]:
        # Drag depends on the velocity that is sought: the second kick takes the one that the first predicts.
        before = a(y, v)
        y = y + h * (v + 0.5 * h * before)
        return y, v + 0.5 * h * (before + a(y, v + h * before))

    return step


def _yoshida(eq: Equation, h: float) -> Step:
    parts = [_symmetric(eq, weight * h) for weight in _WEIGHTS]

    friction = eq.friction_m_per_s2

    def step(y: Real, v: Real) -> tuple[Real, Real]:
        # One direction of friction a step: its parts go forth, back and forth.
        way = (v > 0) - (v < 0) if friction else 0
        for part in parts:
            y, v = part(y, v, way)
        return y, v

    return step


def _symmetric(eq: Equation, h: float) -> Callable[[Real, Real, Real], tuple[Real, Real]]:
    """Half the drag by its own exact flow, a Verlet step of the spring, half the drag: the same forth and back."""
    gamma, drag, friction = eq.gamma_per_s, eq.drag_per_m, eq.friction_m_per_s2
    stiffness, cubic = eq.angular_frequency_per_s**2, eq.cubic_per_m2_s2
    shrink = np.exp(-gamma * h)
    # The time in which quadratic drag acts, shortened by what viscous drag takes of the speed meanwhile.
    reach = drag * (-np.expm1(-gamma * h) / (2.0 * gamma) if gamma else 0.5 * h)
    if np.ndim(shrink) == 0:
        shrink, reach = float(shrink), float(reach)
    half = 0.5 * h

    def step(y: Real, v: Real, way: Real) -> tuple[Real, Real]:
        v = v * shrink / (1.0 + reach * abs(v))
        v = v - half * ((stiffness + cubic * y * y) * y + friction * way)
        y = y + h * v
        v = v - half * ((stiffness + cubic * y * y) * y + friction * way)
        return y, v * shrink / (1.0 + reach * abs(v))

    return step


VERLET = OneStep("verlet", "velocity Verlet", 2, _verlet)
YOSHIDA4 = OneStep("yoshida4", "Yoshida's fourth-order composition", 4, _yoshida)
