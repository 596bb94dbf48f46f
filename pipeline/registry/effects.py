"""The effects in the table of effects, with their labels."""

from __future__ import annotations

from collections.abc import Mapping

EFFECTS: Mapping[str, str] = {
    "spring_mass": "mass of the spring",
    "added_mass": "air that the disc carries along",
    "disc_drag": "drag of the disc",
    "viscous_drag": "viscous drag",
    "quadratic_drag": "quadratic drag",
    "friction": "dry friction",
    "amplitude_dependent_frequency": "frequency that depends on the amplitude",
    "rest_drift": "drift of the rest position",
    "sideways_mode": "sideways mode",
    "harmonics": "harmonics",
    "buoyancy": "buoyancy",
    "speed_of_sound": "speed of sound",
    "temperature": "air temperature",
    "clock_rate": "rate of the clock",
}
