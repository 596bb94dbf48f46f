"""Added mass: the mass of air that a disc carries along."""

from __future__ import annotations

from pipeline.bench.air import TYPICAL_HUMIDITY, TYPICAL_PRESSURE, TYPICAL_TEMPERATURE, air_density
from pipeline.bench.scene import Scene
from pipeline.numerics.estimate import Estimate

ADDED_MASS_SHAPE = 8.0 / 3.0  # of a thin disc over rho a^3: H. Lamb, "Hydrodynamics", 6th ed., 1932, art. 102


def added_mass_kg(scene: Scene) -> float:
    """Return the mass of air carried along by a thin disc that moves broadside on, :math:`(8/3)\\rho a^3`, kg."""
    if scene.disc_diameter_m is None:
        return 0.0
    return ADDED_MASS_SHAPE * scene_air_density(scene) * (0.5 * scene.disc_diameter_m.value) ** 3


def scene_air(scene: Scene) -> tuple[Estimate, Estimate, Estimate]:
    """Return temperature, degC, pressure, Pa, and relative humidity of a scene's air, or typical values."""
    return (
        scene.air_temperature_c or TYPICAL_TEMPERATURE,
        scene.air_pressure_pa or TYPICAL_PRESSURE,
        scene.air_relative_humidity or TYPICAL_HUMIDITY,
    )


def scene_air_density(scene: Scene) -> float:
    """Return the density of a scene's air, kg/m^3; unstated values are 20 degC, 101,325 Pa and 50 %."""
    return air_density(*(each.value for each in scene_air(scene)))
