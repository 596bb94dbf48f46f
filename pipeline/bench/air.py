"""Humid air: density, viscosity and speed of sound.

References
----------
.. [1] A. Picard et al., "Revised formula for the density of moist air (CIPM-2007)", Metrologia 45 (2008) 149,
   doi:10.1088/0026-1394/45/2/004: molar masses and gas constant.
.. [2] O. A. Alduchov, R. E. Eskridge, "Improved Magnus form approximation of saturation vapor pressure",
   J. Appl. Meteor. 35 (1996) 601.
.. [3] W. Sutherland, "The viscosity of gases and molecular force", Phil. Mag. 36 (1893) 507; constants for air:
   1.458e-6 kg/(m s K^1/2) and 110.4 K (U.S. Standard Atmosphere, 1976).
"""

from __future__ import annotations

import math

from pipeline.numerics.estimate import Estimate

__all__ = [
    "TYPICAL_HUMIDITY",
    "TYPICAL_PRESSURE",
    "TYPICAL_TEMPERATURE",
    "U_DENSITY",
    "U_SOUND",
    "U_VISCOSITY",
    "air_density",
    "air_viscosity",
    "saturation_pressure",
    "speed_of_sound",
]

# Relative standard uncertainties of the three formulas at room conditions: what they leave out.
U_DENSITY = 5e-4  # compressibility and enhancement factor, 0.04 % together [1]_
U_VISCOSITY = 5e-3  # Sutherland's two constants 0.3 % below measured air at 20 degC; humidity up to 0.3 %
U_SOUND = 4e-4  # ideal gas: 0.04 % below 331.45 m/s at 0 degC

# What a laboratory's air may be where the scene does not say.
TYPICAL_TEMPERATURE = Estimate(20.0, 3.0, "degC")
TYPICAL_PRESSURE = Estimate(101325.0, 1500.0, "Pa")
TYPICAL_HUMIDITY = Estimate(0.5, 0.2, "")

GAS_CONSTANT = 8.314462618  # J/(mol K)
MOLAR_MASS_DRY_KG = 28.96546e-3
MOLAR_MASS_WATER_KG = 18.01528e-3
ZERO_CELSIUS_K = 273.15


def saturation_pressure(temperature_c: float) -> float:
    """Return the pressure of saturated water vapour, Pa, by Magnus' formula [2]_."""
    return 610.94 * math.exp(17.625 * temperature_c / (temperature_c + 243.04))


def _vapour_fraction(temperature_c: float, pressure_pa: float, relative_humidity: float) -> float:
    # All of it at most: an uncertain humidity may reach beyond what the pressure holds.
    return min(relative_humidity * saturation_pressure(temperature_c) / pressure_pa, 1.0)


def air_density(temperature_c: float, pressure_pa: float = 101325.0, relative_humidity: float = 0.0) -> float:
    """Return the density of humid air, kg/m^3, as a mixture of ideal gases (within 0.1 % at room conditions).

    Examples
    --------
    >>> round(air_density(20.0), 3)
    1.204
    """
    fraction = _vapour_fraction(temperature_c, pressure_pa, relative_humidity)
    molar_kg = MOLAR_MASS_DRY_KG - fraction * (MOLAR_MASS_DRY_KG - MOLAR_MASS_WATER_KG)
    return pressure_pa * molar_kg / (GAS_CONSTANT * (temperature_c + ZERO_CELSIUS_K))


def air_viscosity(temperature_c: float) -> float:
    """Return the dynamic viscosity of air by Sutherland's formula, Pa s.

    Examples
    --------
    >>> round(air_viscosity(20.0) * 1e6, 1)
    18.1
    """
    kelvin = temperature_c + ZERO_CELSIUS_K
    return float(1.458e-6 * kelvin**1.5 / (kelvin + 110.4))


def speed_of_sound(temperature_c: float, pressure_pa: float = 101325.0, relative_humidity: float = 0.0) -> float:
    """Return the speed of sound in humid air, m/s, as a mixture of ideal gases.

    Examples
    --------
    >>> round(speed_of_sound(20.0), 1), round(speed_of_sound(20.0, relative_humidity=1.0), 1)
    (343.2, 344.5)
    """
    fraction = _vapour_fraction(temperature_c, pressure_pa, relative_humidity)
    molar_kg = MOLAR_MASS_DRY_KG - fraction * (MOLAR_MASS_DRY_KG - MOLAR_MASS_WATER_KG)
    # Heat capacities of dry air (1.400) and of water vapour (1.33) mix by their degrees of freedom.
    heat = 3.5 + fraction * (4.03 - 3.5)
    ratio = heat / (heat - 1.0)
    return math.sqrt(ratio * GAS_CONSTANT * (temperature_c + ZERO_CELSIUS_K) / molar_kg)
