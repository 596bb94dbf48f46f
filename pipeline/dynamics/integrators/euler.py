"""Forward and symplectic Euler: the two methods that the lab report compares by eye."""

from __future__ import annotations

import math

from pipeline.dynamics.equation import Equation, Real
from pipeline.dynamics.integrator import Step
from pipeline.dynamics.integrators.one_step import OneStep, acceleration

__all__ = ["FORWARD_EULER", "SYMPLECTIC_EULER"]


def _forward(eq: Equation, h: float) -> Step:
    a = acceleration(eq)

    def step(y: Real, v: Real) -> tuple[Real, Real]:
        return y + h * v, v + h * a(y, v)

    return step


def _symplectic(eq: Equation, h: float) -> Step:
    a = acceleration(eq)

    def step(y: Real, v: Real) -> tuple[Real, Real]:
        v = v + h * a(y, v)
        return y + h * v, v

    return step


def _forward_limit(omega: float, gamma: float) -> float:
    """Eigenvalues 1 + h lambda stay in the unit circle up to -2 Re(lambda) / abs(lambda)^2."""
    if gamma < omega:
        return 2.0 * gamma / omega**2
    return 2.0 / (gamma + math.sqrt((gamma - omega) * (gamma + omega)))


def _symplectic_limit(omega: float, gamma: float) -> float:
    """Both roots of the step's characteristic polynomial stay in the circle: (wh)^2 + 4 gamma h < 4."""
    return 2.0 / (gamma + math.hypot(gamma, omega))


FORWARD_EULER = OneStep("forward-euler", "forward Euler", 1, _forward, _forward_limit)
SYMPLECTIC_EULER = OneStep("symplectic-euler", "symplectic Euler", 1, _symplectic, _symplectic_limit)
