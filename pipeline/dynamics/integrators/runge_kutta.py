"""The classical Runge-Kutta method of order four."""

from __future__ import annotations

from pipeline.dynamics.equation import Equation, Real
from pipeline.dynamics.integrator import Step
from pipeline.dynamics.integrators.one_step import OneStep, acceleration

__all__ = ["RK4"]


def _rk4(eq: Equation, h: float) -> Step:
    a = acceleration(eq)
    half, sixth = 0.5 * h, h / 6.0

    def step(y: Real, v: Real) -> tuple[Real, Real]:
        a1 = a(y, v)
        v2 = v + half * a1
        a2 = a(y + half * v, v2)
        v3 = v + half * a2
        a3 = a(y + half * v2, v3)
        v4 = v + h * a3
        a4 = a(y + h * v3, v4)
        return y + sixth * (v + 2.0 * (v2 + v3) + v4), v + sixth * (a1 + 2.0 * (a2 + a3) + a4)

    return step


RK4 = OneStep("rk4", "classical Runge-Kutta", 4, _rk4)
