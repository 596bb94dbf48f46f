"""Ambient: the air of a scene as uncertain inputs, and what depends on it."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

from pipeline.bench.added_mass import scene_air
from pipeline.bench.air import U_DENSITY, U_SOUND, U_VISCOSITY, air_density, air_viscosity, speed_of_sound
from pipeline.bench.instrument import Instrument
from pipeline.bench.scene import Scene
from pipeline.numerics.estimate import Estimate
from pipeline.results.budget import Inputs, estimate_of, function_of

__all__ = ["Ambient"]


class Ambient:
    """Density, viscosity and distance scale, each made of the same temperature, pressure and humidity.

    Parameters
    ----------
    scene : Scene
    inputs : Inputs
        The variables are added there.
    u_temperature_k : float
        Standard uncertainty of a temperature stated without one, K.

    Notes
    -----
    The uncertainties of the formulas are inputs of value 1. One variable for the temperature: where it
    moves density and speed of sound together, a result sees both.
    """

    def __init__(self, scene: Scene, inputs: Inputs, *, u_temperature_k: float) -> None:
        celsius, pressure, humidity = scene_air(scene)
        self._sonic = scene.tells_of_bench
        self.known = scene.air_temperature_c is not None
        celsius = Estimate(celsius.value, celsius.u or u_temperature_k, "degC")
        self._inputs = inputs
        self._temperature = inputs.add("air_temperature", celsius, "B")
        self._pressure = inputs.add("air_pressure", pressure, "B")
        self._humidity = inputs.add("relative_humidity", humidity, "B")
        self._density_formula = inputs.add("density_formula", Estimate(1.0, U_DENSITY), "B")
        self._viscosity_formula = inputs.add("viscosity_formula", Estimate(1.0, U_VISCOSITY), "B")

    @cached_property
    def density(self) -> Any:
        """Density of the air, kg/m^3."""
        return function_of(air_density, self._temperature, self._pressure, self._humidity) * self._density_formula

    def viscosity(self) -> Any:
        """Return the dynamic viscosity of the air, Pa s."""
        return function_of(air_viscosity, self._temperature, self._pressure) * self._viscosity_formula

    def scale(self, instrument: Instrument) -> Any:
        """Return the factor on all distances: 1, with what the speed of sound or a calibration leaves uncertain.

        Notes
        -----
        A calibrated scale has the calibration's uncertainty and no other. Else the speed of sound is uncertain with
        temperature, pressure, humidity and its formula; and where the record was made with another speed than the
        scene's air has, the difference, which is not corrected, is the half-width of a rectangle. A bench whose air
        has no stated temperature has a room's, 20 +- 3 degC. Where neither a bench is told of nor a speed of sound of
        the record, nothing says that the distances are an echo's: their scale is taken as it stands.
        """
        if instrument.u_scale > 0:
            return self._inputs.add("calibrated_scale", Estimate(1.0, instrument.u_scale), "B")
        if not self._sonic and instrument.speed_of_sound_m_per_s is None:
            return 1.0
        sound = function_of(speed_of_sound, self._temperature, self._pressure, self._humidity)
        actual = estimate_of(sound, "m/s").value
        factor = sound / actual * self._inputs.add("speed_of_sound_formula", Estimate(1.0, U_SOUND), "B")
        if instrument.speed_of_sound_m_per_s is not None:
            half = abs(actual / instrument.speed_of_sound_m_per_s - 1.0)
            factor *= self._inputs.add("recorded_speed_of_sound", Estimate(1.0, half / math.sqrt(3.0)), "B")
        return factor
