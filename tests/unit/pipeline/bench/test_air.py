"""Humid air against published tables."""

import math

import pytest

from pipeline.bench.air import air_density, air_viscosity, speed_of_sound


def cipm_2007(temperature_c: float, pressure_pa: float, humidity: float, carbon_dioxide: float = 4e-4) -> float:
    """Density of moist air by the CIPM-2007 equation with all its constants, kg/m^3.

    A. Picard, R. S. Davis, M. Glaeser, K. Fujii, Metrologia 45 (2008) 149, doi:10.1088/0026-1394/45/2/004, eqs. A1.1
    to A1.4 and 1.
    """
    t, kelvin = temperature_c, temperature_c + 273.15
    saturation = math.exp(1.2378847e-5 * kelvin**2 - 1.9121316e-2 * kelvin + 33.93711047 - 6.3431645e3 / kelvin)
    enhancement = 1.00062 + 3.14e-8 * pressure_pa + 5.6e-7 * t**2
    x = humidity * enhancement * saturation / pressure_pa
    z = (
        1.0
        - pressure_pa
        / kelvin
        * (
            1.58123e-6
            - 2.9331e-8 * t
            + 1.1043e-10 * t**2
            + (5.707e-6 - 2.051e-8 * t) * x
            + (1.9898e-4 - 2.376e-6 * t) * x**2
        )
        + (pressure_pa / kelvin) ** 2 * (1.83e-11 - 0.765e-8 * x**2)
    )
    dry = (28.96546 + 12.011 * (carbon_dioxide - 4e-4)) * 1e-3
    return pressure_pa * dry / (z * 8.314472 * kelvin) * (1.0 - x * (1.0 - 18.01528e-3 / dry))


@pytest.mark.parametrize("temperature_c", [10.0, 20.0, 30.0])
@pytest.mark.parametrize("pressure_pa", [90_000.0, 104_000.0])
@pytest.mark.parametrize("humidity", [0.0, 0.8])
def test_density_is_the_cipm_2007_equations(temperature_c: float, pressure_pa: float, humidity: float) -> None:
    """The density is that of CIPM-2007 within its range, and nearly so a few degrees beyond."""
    expected = cipm_2007(temperature_c, pressure_pa, humidity)
    inside = 15.0 <= temperature_c <= 27.0
    assert air_density(temperature_c, pressure_pa, humidity) == pytest.approx(expected, rel=2e-6 if inside else 1e-4)


@pytest.mark.parametrize(("kelvin", "micropascal_seconds"), [(100.0, 7.09559), (300.0, 18.5230)])
def test_viscosity_is_the_published_check_value(kelvin: float, micropascal_seconds: float) -> None:
    """Lemmon and Jacobsen's table of check values (2004, table V), at zero density."""
    assert air_viscosity(kelvin - 273.15, 1e-3) * 1e6 == pytest.approx(micropascal_seconds, rel=1e-6)


@pytest.mark.parametrize(
    ("temperature_c", "metres_per_second"), [(-20.0, 318.9), (0.0, 331.3), (20.0, 343.2), (30.0, 349.0)]
)
def test_speed_of_sound_in_dry_air(temperature_c: float, metres_per_second: float) -> None:
    """343.2 m/s at 20 degC (O. Cramer, J. Acoust. Soc. Am. 93 (1993) 2510, doi:10.1121/1.405827)."""
    assert speed_of_sound(temperature_c) == pytest.approx(metres_per_second, abs=0.2)
