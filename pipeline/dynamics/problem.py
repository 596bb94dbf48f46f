"""An equation of motion with an initial state, and the derivation of both from a scene."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pipeline.bench.added_mass import added_mass_kg
from pipeline.bench.scene import Scene
from pipeline.bench.spring import oscillating_mass_kg
from pipeline.dynamics.equation import Equation, demand_number
from pipeline.errors import DynamicsError, SceneError
from pipeline.numerics.estimate import Estimate


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
                "is too far or too fast; start nearer, or take a smaller cubic term"
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
            raise SceneError(f"{where}: a simulation needs {', '.join(missing)}; add it to the scene")
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
            raise DynamicsError(f"{where}: {error}") from error


def effective_mass_kg(scene: Scene) -> float:
    """Return the oscillating mass in kg: the bob, the spring's share, and the air that the disc carries along."""
    if scene.bob_mass_kg is None:
        raise SceneError("scene: a mass that oscillates needs [bob] mass_kg; add it to the scene")
    return oscillating_mass_kg(_value(scene.spring_mass_kg), scene.bob_mass_kg.value + added_mass_kg(scene))


def _value(estimate: Estimate | None) -> float:
    return 0.0 if estimate is None else estimate.value
