"""The equation of motion that every integrator solves, its initial state, and the derivation of both from a scene.

.. math:: \\ddot y = -\\omega_0^2 y - 2\\gamma\\dot y - b|\\dot y|\\dot y - f\\,\\mathrm{sign}(\\dot y) - c y^3

Friction holds a bob at rest if the pull of the spring per mass is at most f.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.bench.disc import effective_mass_kg
from pipeline.bench.scene import Scene
from pipeline.errors import DynamicsError, SceneError
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.levels import LARGEST

Real = Any  # a float, or an array of floats for several states

_AMPLITUDE_TO_DRAG = 3.0 * math.pi / 4.0  # b = (3 pi / 4) beta / omega, from the loss per cycle: arXiv:2502.07458


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Equation:
    """The coefficients of the equation of motion.

    Parameters
    ----------
    angular_frequency_per_s : float, 1/s
        Angular frequency :math:`\\omega_0` of the undamped motion at infinitesimal amplitude; positive.
    gamma_per_s : float, 1/s
        Viscous drag :math:`\\gamma`: half the force per mass and speed; negative, it drives the motion.
    drag_per_m : float, 1/m
        Quadratic drag b: the force per mass and squared speed; negative, it drives the motion.
    friction_m_per_s2 : float, m/s^2
        Friction f: the force per mass; negative, it drives the motion.
    cubic_per_m2_s2 : float, 1/(m^2 s^2)
        Cubic coefficient c of a hardening (positive) or softening (negative) spring.

    Raises
    ------
    DynamicsError
        If a coefficient is no number or too large; the message names it.
    """

    angular_frequency_per_s: float
    gamma_per_s: float = 0.0
    drag_per_m: float = 0.0
    friction_m_per_s2: float = 0.0
    cubic_per_m2_s2: float = 0.0

    def __post_init__(self) -> None:
        for name in self.__slots__:
            value = demand_number(getattr(self, name), name)
            object.__setattr__(self, name, value)
        if not self.angular_frequency_per_s > 1.0 / LARGEST:
            raise DynamicsError(f"angular_frequency_per_s must be positive, got {self.angular_frequency_per_s:g}")

    @property
    def is_linear(self) -> bool:
        """Whether a linear spring and viscous drag are the only forces."""
        return not (self.drag_per_m or self.friction_m_per_s2 or self.cubic_per_m2_s2)

    def spring(self, y: Real) -> Real:
        """Return the spring's pull per mass at displacement y, m/s^2, positive towards positive y."""
        pull = self.angular_frequency_per_s**2 * y
        return pull + self.cubic_per_m2_s2 * y * y * y if self.cubic_per_m2_s2 else pull

    def acceleration(self, y: Real, v: Real) -> Real:
        """Return the acceleration, m/s^2, of a moving bob at displacement y and velocity v."""
        force = self.spring(y) + (2.0 * self.gamma_per_s + self.drag_per_m * abs(v)) * v
        return -force - self.friction_m_per_s2 * np.sign(v) if self.friction_m_per_s2 else -force

    def direction(self, y: float, v: float) -> int:
        """Return the direction in which a bob moves or starts from rest: 1, -1, or 0 if friction holds it."""
        if v:
            return 1 if v > 0 else -1
        pull = self.spring(y)
        return 0 if abs(pull) <= self.friction_m_per_s2 else -1 if pull > 0 else 1

    def laws(self) -> tuple[float, float, float]:
        """Return gamma (1/s), beta (1/(m s)) and mu (m/s) of the averaged law dA/dt = -(mu + gamma A + beta A^2)."""
        omega = self.angular_frequency_per_s
        beta = self.drag_per_m * omega / _AMPLITUDE_TO_DRAG
        return self.gamma_per_s, beta, 2.0 * self.friction_m_per_s2 / (math.pi * omega)

    @classmethod
    def from_laws(
        cls,
        angular_frequency_per_s: float,
        *,
        gamma_per_s: float = 0.0,
        beta_per_m_s: float = 0.0,
        mu_m_per_s: float = 0.0,
        cubic_per_m2_s2: float = 0.0,
    ) -> Equation:
        """Return the equation whose averaged amplitude law is dA/dt = -(mu + gamma A + beta A^2).

        In each cycle a force F per mass takes :math:`\\oint F\\,dy` from the energy per mass :math:`\\omega^2A^2/2`.
        For the forces :math:`2\\gamma\\dot y`, :math:`b\\dot y^2` and :math:`f` the resulting law is
        :math:`\\dot A = -(2f/\\pi\\omega + \\gamma A + (4\\omega/3\\pi)\\,b A^2)` (Lelas, Pezer, arXiv:2502.07458).

        >>> round(Equation.from_laws(8.66, beta_per_m_s=0.235).laws()[1], 12)
        0.235
        """
        return cls(
            angular_frequency_per_s=angular_frequency_per_s,
            gamma_per_s=gamma_per_s,
            drag_per_m=_AMPLITUDE_TO_DRAG * beta_per_m_s / angular_frequency_per_s,
            friction_m_per_s2=0.5 * math.pi * angular_frequency_per_s * mu_m_per_s,
            cubic_per_m2_s2=cubic_per_m2_s2,
        )


def demand_number(given: Any, name: str) -> float:
    """Return a number of a scene as a float, or refuse what is none or beyond every bench."""
    try:
        value = float(given)
    except (TypeError, ValueError):
        value = math.nan
    if not abs(value) <= LARGEST:
        raise DynamicsError(f"{name} must be a number of at most {LARGEST:g} in SI units, got {given!r:.80}")
    return value


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """An equation of motion and an initial state.

    Parameters
    ----------
    equation : Equation
    displacement_m : float, m
        Displacement at t = 0.
    velocity_m_per_s : float, m/s
        Velocity at t = 0.

    Raises
    ------
    DynamicsError
        If a start value is no number or too large, or if the start lets a softening spring stretch beyond the point up
        to which it pulls back.
    """

    equation: Equation
    displacement_m: float
    velocity_m_per_s: float = 0.0

    def __post_init__(self) -> None:
        for name in ("displacement_m", "velocity_m_per_s"):
            object.__setattr__(self, name, demand_number(getattr(self, name), name))
        eq = self.equation
        if eq.cubic_per_m2_s2 >= 0.0:
            return
        reach = eq.angular_frequency_per_s / math.sqrt(-eq.cubic_per_m2_s2)
        y, v = abs(self.displacement_m) / reach, abs(self.velocity_m_per_s) / eq.angular_frequency_per_s / reach
        # Within reach, and without the energy to leave it.
        if not (y < 1.0 and v * v + y * y * (1.0 - 0.5 * y * y) < 0.5):
            raise DynamicsError(
                f"a softening spring holds its bob within {reach:g} m of rest, the start at {self.displacement_m:g} m "
                "is too far or too fast",
                "start nearer, or take a smaller cubic term",
            )

    def amplitude_m(self) -> float:
        """Return the amplitude of the undamped linear oscillation with this initial state, m."""
        return math.hypot(self.displacement_m, self.velocity_m_per_s / self.equation.angular_frequency_per_s)

    @classmethod
    def from_scene(cls, scene: Scene, *, where: str = "scene") -> Problem:
        """Return the problem that a scene describes; ``where`` names the scene in errors.

        :math:`\\omega_0^2 = k/(m + m_s/3 + m_a)` with the mass :math:`m_s` of the spring and the mass :math:`m_a` of
        the air that the disc carries along. The coefficients of ``[damping]`` are those of the amplitude laws. Missing
        values count as zero, except bob mass, spring constant and starting displacement.
        """
        needed = {
            "[bob] mass_kg": scene.bob_mass_kg,
            "[spring] constant_n_per_m": scene.spring_constant_n_per_m,
            "[start] displacement_m": scene.start_displacement_m,
        }
        missing = [name for name, value in needed.items() if value is None]
        if missing:
            raise SceneError(f"{where}: a simulation needs {', '.join(missing)}", "add it to the scene")
        mass = effective_mass_kg(scene)
        try:
            equation = Equation.from_laws(
                math.sqrt(_value(scene.spring_constant_n_per_m) / mass),
                gamma_per_s=_value(scene.gamma_per_s),
                beta_per_m_s=_value(scene.beta_per_m_s),
                mu_m_per_s=_value(scene.mu_m_per_s),
                cubic_per_m2_s2=_value(scene.spring_cubic_n_per_m3) / mass,
            )
            return cls(equation, _value(scene.start_displacement_m), _value(scene.start_velocity_m_per_s))
        except DynamicsError as error:
            raise DynamicsError(error.problem, error.remedy, where=f"{where}: ") from error


def _value(estimate: Estimate | None) -> float:
    return 0.0 if estimate is None else estimate.value
