"""Disc: the air that it carries along, and its drag where a scene states no damping: vortices shed by its edge.

Friction of the air along disc and bob, 3 % of this drag at a usual bench, is left out, as are losses in suspension and
spring, which cannot be derived. Measured coefficients of a flat plate follow 8.0 KC^(-1/3) (J. M. R. Graham, J. Fluid
Mech. 97 (1980) 331); the law is the same for each piece of a disc's edge (P. de Bernardinis, J. M. R. Graham, K. H.
Parker, J. Fluid Mech. 102 (1981) 279); the flow at the edges is in H. Lamb, "Hydrodynamics", 6th ed., art. 71 and 108.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.bench.air import (
    TYPICAL_HUMIDITY,
    TYPICAL_PRESSURE,
    TYPICAL_TEMPERATURE,
    U_STATED_TEMPERATURE_K,
    air_density,
)
from pipeline.bench.scene import Scene
from pipeline.bench.spring import oscillating_mass_kg
from pipeline.errors import SceneError
from pipeline.numerics.estimate import Estimate, Joint

ADDED_MASS_SHAPE = 8.0 / 3.0  # of a thin disc over rho a^3: H. Lamb, "Hydrodynamics", 6th ed. (1932), art. 102


def added_mass_kg(scene: Scene) -> float:
    """Return the mass of air carried along by a thin disc that moves broadside on, :math:`(8/3)\\rho a^3`, kg."""
    if scene.disc_diameter_m is None:
        return 0.0
    return ADDED_MASS_SHAPE * scene_air_density(scene) * (0.5 * scene.disc_diameter_m.value) ** 3


def effective_mass_kg(scene: Scene) -> float:
    """Return the oscillating mass in kg: the bob, the spring's share, and the air that the disc carries along."""
    if scene.bob_mass_kg is None:
        raise SceneError("scene: a mass that oscillates needs [bob] mass_kg", "add it to the scene")
    spring_kg = 0.0 if scene.spring_mass_kg is None else scene.spring_mass_kg.value
    return oscillating_mass_kg(spring_kg, scene.bob_mass_kg.value + added_mass_kg(scene))


def scene_air(scene: Scene) -> tuple[Estimate, Estimate, Estimate]:
    """Return temperature, degC, pressure, Pa, and relative humidity of a scene's air, or typical values."""
    celsius = scene.air_temperature_c or TYPICAL_TEMPERATURE
    return (
        Estimate(celsius.value, celsius.u or U_STATED_TEMPERATURE_K, "degC"),
        scene.air_pressure_pa or TYPICAL_PRESSURE,
        scene.air_relative_humidity or TYPICAL_HUMIDITY,
    )


def scene_air_density(scene: Scene) -> float:
    """Return the density of a scene's air, kg/m^3; unstated values are 20 degC, 101,325 Pa and 50 %."""
    return air_density(*(each.value for each in scene_air(scene)))


# Drag coefficient of a disc broadside on in steady flow, Re > 1000: S. F. Hoerner, "Fluid-Dynamic Drag" (1965).
STEADY_DISC_DRAG = 1.17
U_SHED = 0.2  # relative uncertainty: scatter of measured plates about the law, and its transfer to a disc
SOURCES = "u 20 %; Graham 1980, de Bernardinis et al. 1981"


@dataclass(frozen=True, slots=True)
class DerivedDrag:
    """Coefficients of dA/dt = -(gamma A + beta A^2), named as the scene's attributes, and words on their origin."""

    joint: Joint
    words: str


def needs_drag(scene: Scene) -> bool:
    """Return whether a scene states a disc but no damping at all."""
    silent = scene.gamma_per_s is None and scene.beta_per_m_s is None and scene.mu_m_per_s is None
    return silent and scene.disc_diameter_m is not None


def disc_drag_coefficient(keulegan_carpenter: float) -> float:
    """Return the drag coefficient of a thin disc oscillating broadside on, for its area and maximum speed.

    The vortices of a sharp edge do not depend on the body, and their force is proportional to the velocity at the edge
    to the power 8/3. The velocity at a disc's edge is :math:`2/\\pi` of that at a plate's. A disc has twice as much
    edge per area. So the coefficient is :math:`8.0\\,(2/\\pi)^{8/3}\\,2\\,KC^{-1/3} = 4.8\\,KC^{-1/3}`,
    until it reaches the steady value 1.17 at KC near 70.
    """
    if keulegan_carpenter <= 0.0:
        return math.inf
    return max(16.0 * math.pow(2.0 / math.pi, 8.0 / 3.0) / math.cbrt(keulegan_carpenter), STEADY_DISC_DRAG)


def disc_rate(scene: Scene, amplitude_m: float, angular_frequency: float) -> tuple[float, float]:
    """Return the damping rate -dA/dt/A by the disc of a scene, 1/s, and the Keulegan-Carpenter number, at an amplitude.

    The mean of the drag over a cycle gives :math:`4 \\omega A \\rho C S / (3\\pi\\,2m)`.
    """
    if scene.bob_mass_kg is None or scene.disc_diameter_m is None:
        raise SceneError("scene: drag is derived for a [bob] mass_kg with a [disc] diameter_m", "add both")
    diameter = scene.disc_diameter_m.value
    area, kc = 0.25 * math.pi * diameter**2, 2.0 * math.pi * amplitude_m / diameter
    drag_per_m = 0.5 * scene_air_density(scene) * disc_drag_coefficient(kc) * area / effective_mass_kg(scene)
    return 4.0 * drag_per_m * angular_frequency * amplitude_m / (3.0 * math.pi), kc


def derive_drag(scene: Scene, amplitude_m: float, seconds: float) -> DerivedDrag:
    """Return the damping of a motion of some amplitude and duration by the disc of a scene.

    The drag coefficient is proportional to the amplitude to the power -1/3, so that dA/dt = -c A^(5/3). Least squares
    over the logarithm of the amplitude, from the start to the end, approximate c A^(2/3) by gamma + beta A.
    """
    if scene.bob_mass_kg is None or scene.spring_constant_n_per_m is None or scene.disc_diameter_m is None:
        raise SceneError("scene: drag is derived for a [bob] mass_kg on a [spring] constant_n_per_m", "add both")
    omega = math.sqrt(scene.spring_constant_n_per_m.value / effective_mass_kg(scene))
    values, first, kc = np.zeros(2), 0.0, 0.0
    if amplitude_m > 0.0:
        first, kc = disc_rate(scene, amplitude_m, omega)
        left = (1.0 + first * seconds / 1.5) ** -1.5
        amplitudes = amplitude_m * np.geomspace(min(left, 0.9), 1.0, 40)
        rates = np.array([disc_rate(scene, each, omega)[0] for each in amplitudes.tolist()])
        columns = np.stack([np.ones(40), amplitudes / amplitude_m], axis=1) / rates[:, None]
        values = np.maximum(np.linalg.lstsq(columns, np.ones(40), rcond=None)[0], 0.0) / [1.0, amplitude_m]
    covariance = np.outer(U_SHED * values, U_SHED * values)  # the law's uncertainty moves both alike
    joint = Joint(("gamma_per_s", "beta_per_m_s"), values, covariance, ("1/s", "1/(m s)"))
    return DerivedDrag(joint, f"disc at KC {kc:.3g}, {first:.2g} 1/s at the start ({SOURCES})")
