"""Humid air: density, viscosity and speed of sound by the published reference equations.

The equations for density and speed of sound apply only to air under laboratory conditions. Beyond their ranges a
mixture of ideal gases is used, multiplied by the ratio of the equation to the mixture at the nearest point of the
range. So there is no step, and no polynomial is extrapolated.

References
----------
.. [1] A. Picard et al., "Revised formula for the density of moist air (CIPM-2007)", Metrologia 45 (2008) 149,
   doi:10.1088/0026-1394/45/2/004.
.. [2] O. Cramer, "The variation of the specific heat ratio and the speed of sound in air with temperature, pressure,
   humidity, and CO2 concentration", J. Acoust. Soc. Am. 93 (1993) 2510, doi:10.1121/1.405827.
.. [3] E. W. Lemmon, R. T. Jacobsen, "Viscosity and thermal conductivity equations for nitrogen, oxygen, argon, and
   air", Int. J. Thermophys. 25 (2004) 21, doi:10.1023/B:IJOT.0000022327.04529.f3.
.. [4] O. A. Alduchov, R. E. Eskridge, "Improved Magnus form approximation of saturation vapor pressure",
   J. Appl. Meteor. 35 (1996) 601.
"""

from __future__ import annotations

import functools
import math

from pipeline.numerics.estimate import Estimate

# Relative standard uncertainties of the three equations for a laboratory's air.
U_DENSITY = 2e-4  # equation: 22 ppm [1]_; carbon dioxide of a lecture room, 400 to 1500 ppm: up to 0.04 %
U_VISCOSITY = 5e-3  # equation: 1 % at k = 2 [3]_; humidity, which it ignores: up to 0.3 %
U_SOUND = 3e-4  # equation [2]_, including carbon dioxide

# Standard uncertainty of an air temperature stated without one, K; the limit of error of a resistance thermometer of
# class B is 0.4 K at 20 degrees (IEC 60751).
U_STATED_TEMPERATURE_K = 0.5
# Typical air of a laboratory, where the scene does not state it.
TYPICAL_TEMPERATURE = Estimate(20.0, 3.0, "degC")
TYPICAL_PRESSURE = Estimate(101325.0, 1500.0, "Pa")
TYPICAL_HUMIDITY = Estimate(0.5, 0.2, "")

GAS_CONSTANT, ZERO_CELSIUS_K = 8.314462618, 273.15  # J/(mol K), CODATA 2018; K, by definition (CGPM, 1954)
CARBON_DIOXIDE = 4e-4  # mole fraction [1]_
MOLAR_MASS_DRY_KG, MOLAR_MASS_WATER_KG = 28.96546e-3, 18.01528e-3  # kg/mol [1]_, with this fraction


def saturation_pressure(temperature_c: float) -> float:
    """Return the pressure of saturated water vapour, Pa, by the Magnus formula [4]_: the maximum of any humidity."""
    return 610.94 * math.exp(17.625 * temperature_c / (temperature_c + 243.04))


def air_density(temperature_c: float, pressure_pa: float = 101325.0, relative_humidity: float = 0.0) -> float:
    """Return the density of humid air, kg/m^3, by CIPM-2007 [1]_ (600 to 1100 hPa, 15 to 27 degC).

    >>> round(air_density(20.0), 4)
    1.2046
    """
    t, p = _within(temperature_c, 15.0, 27.0), _within(pressure_pa, 6e4, 1.1e5)
    fraction = _vapour_fraction(temperature_c, pressure_pa, relative_humidity)
    molar_kg = MOLAR_MASS_DRY_KG - fraction * (MOLAR_MASS_DRY_KG - MOLAR_MASS_WATER_KG)
    compressibility = _compressibility(t, p, _vapour_fraction(t, p, relative_humidity))
    return pressure_pa * molar_kg / (compressibility * GAS_CONSTANT * (temperature_c + ZERO_CELSIUS_K))


def _within(x: float, least: float, greatest: float) -> float:
    return min(max(x, least), greatest)


def _vapour_fraction(temperature_c: float, pressure_pa: float, relative_humidity: float) -> float:
    """Return the mole fraction of water, which both equations use ([1]_ A1.1 to A1.3).

    It is at most 1: an uncertain humidity may exceed what the pressure allows.
    """
    t, kelvin = temperature_c, temperature_c + ZERO_CELSIUS_K
    saturated = math.exp(1.2378847e-5 * kelvin**2 - 1.9121316e-2 * kelvin + 33.93711047 - 6.3431645e3 / kelvin)
    enhancement = 1.00062 + 3.14e-8 * pressure_pa + 5.6e-7 * t**2
    if pressure_pa <= 0.0:  # an uncertain pressure may reach zero
        return 1.0
    return min(relative_humidity * enhancement * saturated / pressure_pa, 1.0)


def _compressibility(t: float, p: float, x: float) -> float:
    """Return Z of [1]_ A1.4 at temperature t, degC, pressure p, Pa, and mole fraction x of water."""
    kelvin = t + ZERO_CELSIUS_K
    first = 1.58123e-6 - 2.9331e-8 * t + 1.1043e-10 * t**2
    first += (5.707e-6 - 2.051e-8 * t) * x + (1.9898e-4 - 2.376e-6 * t) * x**2
    return 1.0 - p / kelvin * first + (p / kelvin) ** 2 * (1.83e-11 - 0.765e-8 * x**2)


def air_viscosity(temperature_c: float, pressure_pa: float = 101325.0) -> float:
    """Return the dynamic viscosity of dry air, Pa s, by Lemmon and Jacobsen's equation [3]_.

    >>> round(air_viscosity(20.0) * 1e6, 2)
    18.21
    """
    kelvin = temperature_c + ZERO_CELSIUS_K
    log = math.log(kelvin / 103.3)
    collision = math.exp(0.431 - 0.4623 * log + 0.08406 * log**2 + 0.005341 * log**3 - 0.00331 * log**4)
    dilute = 0.0266958 * math.sqrt(28.9586 * kelvin) / (0.1296 * collision)
    # Contribution of the density: 0.08 % at one atmosphere; terms of higher order matter only for liquids.
    tau, delta = 132.6312 / kelvin, pressure_pa / (GAS_CONSTANT * kelvin * 10447.7)
    dense = 10.72 * tau**0.2 * delta - 8.876 * tau**0.6 * delta * math.exp(-delta)
    return float(1e-6 * (dilute + dense))


@functools.lru_cache(64)
def speed_of_sound(temperature_c: float, pressure_pa: float = 101325.0, relative_humidity: float = 0.0) -> float:
    """Return the speed of sound in humid air, m/s, by Cramer's equation [2]_ (0 to 30 degC, 75 to 102 kPa).

    >>> round(speed_of_sound(20.0), 1), round(speed_of_sound(20.0, relative_humidity=1.0), 1)
    (343.4, 344.6)
    """
    t, p = _within(temperature_c, 0.0, 30.0), _within(pressure_pa, 7.5e4, 1.02e5)
    x = min(_vapour_fraction(t, p, relative_humidity), 0.06)
    nearest = _cramer(t, p, x) / _ideal_sound(t, x)
    return nearest * _ideal_sound(temperature_c, _vapour_fraction(temperature_c, pressure_pa, relative_humidity))


def _cramer(t: float, p: float, x: float) -> float:
    """Return the polynomial of [2]_, table III, at t, degC, p, Pa, and the mole fraction x of water."""
    co2 = CARBON_DIOXIDE
    dry = 331.5024 + 0.603055 * t - 0.000528 * t**2
    water = (51.471935 + 0.1495874 * t - 0.000782 * t**2) * x - 2.835149 * x**2
    pressure = (-1.82e-7 + 3.73e-8 * t - 2.93e-10 * t**2) * p - 2.15e-13 * p**2
    carbon = (-85.20931 - 0.228525 * t + 5.91e-5 * t**2) * co2 + 29.179762 * co2**2
    return dry + water + pressure + carbon + 0.000486 * x * p * co2


def _ideal_sound(temperature_c: float, fraction: float) -> float:
    molar_kg = MOLAR_MASS_DRY_KG - fraction * (MOLAR_MASS_DRY_KG - MOLAR_MASS_WATER_KG)
    # Molar heat capacities of dry air (ratio 1.400) and water vapour (1.33) add by mole fraction.
    heat = 3.5 + fraction * (4.03 - 3.5)
    return math.sqrt(heat / (heat - 1.0) * GAS_CONSTANT * (temperature_c + ZERO_CELSIUS_K) / molar_kg)
