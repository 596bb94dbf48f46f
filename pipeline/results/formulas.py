"""The results of a run as a table of formulas: one function a result.

The parameters of a function are the results and the inputs that it needs, by name. A result is left out if one of them
is missing or None; a parameter with a default may be missing. Inputs come from :mod:`pipeline.results.derive`. The page
of estimates is written from this table.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from typing import Any

from uncertainties import wrap

from pipeline.bench.disc import ADDED_MASS_SHAPE
from pipeline.bench.spring import oscillating_mass_kg


class ResultFormula:
    """A result as a function of others, with its definition in words and conditions: inputs that must be there too."""

    def __init__(self, function: Callable[..., Any], definition: str = "", *conditions: str) -> None:
        self.function, self.definition = function, definition
        parameters = inspect.signature(function).parameters.values()
        self.parameters = tuple(each.name for each in parameters)
        self.needed = (*conditions, *(each.name for each in parameters if each.default is each.empty))


def solve(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return every result that the inputs determine, by name.

    >>> {name: round(x, 3) for name, x in solve({"phase_slope": 8.0, "time_factor": 1.001}).items()}
    {'period': 0.785, 'frequency': 1.275, 'angular_frequency': 8.008}
    """
    found = dict(inputs)

    def value(name: str) -> Any:
        if name not in found:
            formula = FORMULAS.get(name)
            if formula is None or any(value(each) is None for each in formula.needed):
                found[name] = None
            else:
                given = {each: x for each in formula.parameters if (x := value(each)) is not None}
                found[name] = formula.function(**given)
        return found[name]

    return {name: x for name in FORMULAS if (x := value(name)) is not None}


FORMULAS: Mapping[str, ResultFormula] = {
    "period": ResultFormula(
        lambda angular_frequency: 2 * math.pi / angular_frequency, "T = 2π/ω, of the damped motion"
    ),
    "period_small_swings": ResultFormula(
        lambda small_frequency: 2 * math.pi / small_frequency,
        "T_s = 2π/ω_s, of very small swings: ω of the law of the amplitude that fits the phases best, at A = 0. u "
        "includes the largest difference to the laws that fit about as well. Absent if no law of the amplitude does",
    ),
    "frequency": ResultFormula(lambda angular_frequency: angular_frequency / (2 * math.pi), "f = ω/2π"),
    "angular_frequency": ResultFormula(
        lambda phase_slope, time_factor: phase_slope * time_factor,
        "ω: slope of a straight line through the phases of the windows, the mean over the run",
    ),
    "amplitude": ResultFormula(
        lambda law_start, lengths, crest: law_start * lengths * crest, "A₀ = A(0), at the start"
    ),
    "offset": ResultFormula(
        lambda rest_position, distance_scale, sensor_zero, offset_misfit: (
            rest_position * distance_scale + sensor_zero + offset_misfit
        ),
        "rest position y₀, mean over the run",
    ),
    "phase": ResultFormula(
        lambda start_phase, phase_misfit, filtered: start_phase + phase_misfit + filtered[1],
        "φ(0), at the start, in (-π, π]",
    ),
    "noise": ResultFormula(
        lambda noise_of_samples: noise_of_samples,
        "σ of one sample about the fit of its window: 1.4826 times the median absolute residual",
    ),
    "damping_rate": ResultFormula(
        lambda law_rate, rates: law_rate * rates,
        "λ = -Ȧ/A at the start: γ + β A₀ for linear and quadratic drag together",
    ),
    "displacement_amplitude": ResultFormula(
        lambda swing, order: swing if order else None,
        "for accelerations A₀/(ω² + λ²) with λ at the start; for velocities A₀/√(ω² + λ²)",
        "of_length",
    ),
    "angle_amplitude": ResultFormula(
        lambda swing, order: swing if order else None,
        "for angular velocities, for example of a phone on a pendulum, A₀/√(ω² + λ²)",
        "of_angle",
    ),
    "velocity_rms": ResultFormula(
        lambda angular_frequency, lengths, law_rms, motion_per_value: (
            angular_frequency * lengths * law_rms * motion_per_value
        ),
        "v_rms = ω √(mean of A²/2) over the windows of the analysed part",
    ),
    "gravity": ResultFormula(
        lambda pendulum_length, frequency_at_rest: pendulum_length * frequency_at_rest**2,
        "g = l ω₀², with ω₀ of very small swings by the law of the period of a pendulum; for an angle, an angular "
        "velocity or a horizontal position l sin θ. Strong damping: ω(1 + A²/16) with the mean A² of the run",
    ),
    "quality_factor": ResultFormula(
        lambda squared_natural_frequency, damping_rate: 0.5 * squared_natural_frequency**0.5 / damping_rate,
        "Q = ω₀/2λ, with λ at the start and ω₀ of the undamped motion; absent if λ is not positive",
        "decays",
    ),
    "spring_constant": ResultFormula(
        lambda squared_natural_frequency, effective_mass_kg, stiffness_factor=1.0: (
            squared_natural_frequency * effective_mass_kg * stiffness_factor
        ),
        "k = ω₀² m_s/x² with x tan x = m_s/(m + m_a); for a light spring k = ω₀² (m + m_a + m_s/3). ω₀ is that "
        "of the undamped motion, m the mass of the bob, m_s that of the spring, and m_a = (8/3) ρ a³ that of "
        "the air moved by a disc of radius a. m_a and m_s are included if their effect exceeds a tenth of k's "
        "relative uncertainty. ω is the mean over the run; where the frequency changes, u includes the difference to "
        "that of very small swings or at the start",
        "of_spring",
    ),
    "keulegan_carpenter_number": ResultFormula(
        lambda swing, disc_diameter: 2 * math.pi * swing / disc_diameter, "KC = 2π A₀/D", "displacement"
    ),
    "reynolds_number": ResultFormula(
        lambda reynolds_per_speed, velocity_rms: reynolds_per_speed * velocity_rms,
        "Re = ρ v_rms D/η, with `velocity_rms`, so for the whole analysed part and not for its start",
    ),
    "reynolds_number_start": ResultFormula(
        lambda reynolds_per_speed, angular_frequency, swing: (
            reynolds_per_speed * angular_frequency * swing / math.sqrt(2.0)
        ),
        "Re₀ = ρ v₀ D/η with v₀ = ω A₀/√2, at the start",
    ),
    "drag_coefficient": ResultFormula(
        lambda drag_per_beta, coefficients: drag_per_beta * coefficients["beta"][0],
        "C = 3π M β/(2 ω ρ S) with M the mass that swings, S = π D²/4, if β belongs to the only admissible law",
        "beta_settled",
    ),
    # What other results, the curves and comparisons need.
    "squared_natural_frequency": ResultFormula(
        lambda angular_frequency, time_factor, squared_rate: angular_frequency**2 + squared_rate * time_factor**2,
        "Square of the angular frequency of the undamped motion: ω² and the mean squared rate ρ²",
    ),
    "small_frequency": ResultFormula(lambda small_swings, time_factor: small_swings * time_factor),
    "filtered": ResultFormula(
        lambda angular_frequency, sensor_filter: sensor_filter(angular_frequency),
        "Gain of the sensor's filter, and the delay of an oscillation by it, rad",
    ),
    "lengths": ResultFormula(
        lambda distance_scale, amplitude_factor, filtered: distance_scale * amplitude_factor / filtered[0]
    ),
    "rates": ResultFormula(lambda time_factor, rate_factor: time_factor * rate_factor),
    "coefficients": ResultFormula(
        lambda law, rates, lengths, damping_rate, amplitude: law(rates, lengths, damping_rate, amplitude)
    ),
    "motion_per_value": ResultFormula(
        lambda squared_natural_frequency, order: squared_natural_frequency ** (-0.5 * order) if order else 1.0,
        "Displacement or angle over the recorded value, which is its time derivative of some order",
    ),
    "displacement": ResultFormula(
        lambda motion_per_value: motion_per_value,
        "Displacement over the recorded value; it is unknown for a voltage or a force",
        "of_length",
    ),
    "swing": ResultFormula(
        lambda amplitude, angular_frequency, damping_rate, order: (
            amplitude * (angular_frequency**2 + damping_rate**2) ** (-0.5 * order) if order else amplitude
        ),
        "Amplitude of the displacement or the angle whose time derivative was recorded",
    ),
    "frequency_at_rest": ResultFormula(
        lambda angular_frequency, law_rms, motion_per_value, small_frequency=None: (
            small_frequency
            if small_frequency is not None
            else angular_frequency * (1.0 + (law_rms * motion_per_value) ** 2 / 8.0)
        ),
        "Angular frequency of a pendulum at rest; a change with the amplitude that is not seen is below its u",
        "of_pendulum",
    ),
    "carried_air": ResultFormula(
        lambda air, disc_diameter: ADDED_MASS_SHAPE / 8.0 * air.density * disc_diameter**3, "", "of_added_mass"
    ),
    "own_mass_kg": ResultFormula(lambda bob_mass, carried_air=0.0: bob_mass + carried_air),
    "effective_mass_kg": ResultFormula(
        lambda own_mass_kg, spring_mass=None, unstated_spring_mass=0.0: (
            own_mass_kg + unstated_spring_mass / 3.0
            if spring_mass is None
            else wrap(oscillating_mass_kg)(spring_mass, own_mass_kg)
        )
    ),
    "half_stiffness": ResultFormula(
        lambda angular_frequency, distance_scale, filtered, displacement, effective_mass_kg=1.0: (
            0.5 * (angular_frequency * distance_scale / filtered[0] * displacement) ** 2 * effective_mass_kg
        ),
        "Mechanical energy over the squared recorded amplitude; per kilogram if no mass is known",
    ),
    "reynolds_per_speed": ResultFormula(
        lambda known_air, disc_diameter: known_air.density * disc_diameter / known_air.viscosity(), "", "displacement"
    ),
    "drag_per_beta": ResultFormula(
        lambda effective_mass_kg, angular_frequency, known_air, disc_diameter, displacement: (
            6.0 * effective_mass_kg / (angular_frequency * known_air.density * disc_diameter**2) / displacement
        )
    ),
    "drag_length": ResultFormula(
        lambda drag_per_beta, time_factor, distance_scale, filtered: (
            drag_per_beta * time_factor / distance_scale * filtered[0]
        ),
        "Drag coefficient over -Ȧ/A² of the recorded amplitude",
    ),
}
"""All results by name, in the order in which they are listed."""
