"""Ambient: the air of a scene as uncertain inputs, and the quantities that depend on it."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

from uncertainties import wrap

from pipeline.bench.air import U_DENSITY, U_SOUND, U_VISCOSITY, air_density, air_viscosity, speed_of_sound
from pipeline.bench.disc import scene_air
from pipeline.bench.scene import Scene
from pipeline.numerics.estimate import Estimate
from pipeline.results.budget import Inputs
from pipeline.track import Track


class Ambient:
    """Density, viscosity and distance scale, calculated from the same temperature, pressure and humidity.

    The uncertainties of the formulas are inputs with the value 1. Density and speed of sound share one variable for the
    temperature, so results include their correlation.
    """

    def __init__(self, scene: Scene, inputs: Inputs) -> None:
        celsius, pressure, humidity = scene_air(scene)
        self._sensor = scene.tells_of_sensor
        self.known = scene.air_temperature_c is not None
        self._inputs = inputs
        self._temperature = inputs.add("air_temperature", celsius, "B")
        self._pressure = inputs.add("air_pressure", pressure, "B")
        self._humidity = inputs.add("relative_humidity", humidity, "B")
        self._density_formula = inputs.add("density_formula", Estimate(1.0, U_DENSITY), "B")
        self._viscosity_formula = inputs.add("viscosity_formula", Estimate(1.0, U_VISCOSITY), "B")

    @cached_property
    def density(self) -> Any:
        """Density of the air, kg/m^3."""
        return wrap(air_density)(self._temperature, self._pressure, self._humidity) * self._density_formula

    def viscosity(self) -> Any:
        """Return the dynamic viscosity of the air, Pa s."""
        return wrap(air_viscosity)(self._temperature, self._pressure) * self._viscosity_formula

    def scale(self, track: Track) -> Any:
        """Return the factor on all distances: 1, with the uncertainty of the speed of sound or of a calibration.

        If the record used another speed of sound than that of the scene's air, the difference is not corrected; it is
        the half-width of a rectangular distribution. If the scene states no air temperature, that of a room is used, 20
        +- 3 degC. If neither record nor scene names a rangefinder, the distances need not come from echoes, and
        their scale is exact.
        """
        if track.u_scale > 0:
            return self._inputs.add("calibrated_scale", Estimate(1.0, track.u_scale), "B")
        if not self._sensor and not track.sonic:
            return 1.0
        sound = wrap(speed_of_sound)(self._temperature, self._pressure, self._humidity)
        actual = Estimate.of_variable(sound, "m/s").value
        factor = sound / actual * self._inputs.add("speed_of_sound_formula", Estimate(1.0, U_SOUND), "B")
        if track.speed_of_sound_m_per_s is not None:
            half = abs(actual / track.speed_of_sound_m_per_s - 1.0)
            factor *= self._inputs.add("recorded_speed_of_sound", Estimate(1.0, half / math.sqrt(3.0)), "B")
        return factor
