"""Whether the values of a scene are those of a bench, by what each does; a slip of the unit is named with readings."""

from __future__ import annotations

import math
from typing import NamedTuple

from pipeline.bench.scene import BENCH_KEYS, PLACES, Scene
from pipeline.bench.spring import GRAVITY_M_PER_S2
from pipeline.bench.typed import other_reading
from pipeline.numerics.estimate import Estimate

USUAL: dict[str, tuple[float, float]] = {
    "bob_mass_kg": (1e-3, 20.0),
    "pendulum_length_m": (0.01, 100.0),
    "disc_diameter_m": (0.0, 1.0),
    "air_temperature_c": (-30.0, 50.0),
    "air_pressure_pa": (5e4, 1.1e5),
    "sensor_sigma_m": (0.0, 0.05),
    "sensor_lag_s": (0.0, 1.0),
    "start_displacement_m": (-2.0, 2.0),
    "start_velocity_m_per_s": (-10.0, 10.0),
}
"""Ranges of a bench: the air pressures at which people live, and the distances and speeds of a hall."""
# Bobs that a spring may weigh. It is chosen: ten times the heaviest laboratory spring, 50 g, on a bob of 0.1 kg.
SPRING_BOBS = 5.0
LONGEST_RANGE_M = 10.0  # of a rangefinder (data sheet of the MaxBotix XL-MaxSonar); no spring sags further
# Ratio of two readings above which a slip would decide the results: by definition an inch is 2.54 cm, and other units
# of a bench differ by 100 and more.
DECIDING = 20.0


class Slip(NamedTuple):
    """A value that is perhaps a slip: in words, which end in both readings of its number if there are two."""

    attribute: str  # of the scene
    words: str  # from the number on, without a full stop, but with a question mark
    asks: bool
    decides: bool  # whether the readings differ so much that no result from this value can be sound

    @property
    def clause(self) -> str:
        """The words behind the label of the value."""
        return f"{BENCH_KEYS[PLACES[self.attribute]].label} = {self.words}"


def slips(scene: Scene) -> tuple[Slip, ...]:
    """Return the values that are perhaps slips, and those that are no larger than their uncertainties.

    >>> [slip.clause for slip in slips(Scene(disc_diameter_m=10.2))]
    ['diameter of the disc = 10.2 is larger than a bench: 10.2 m or 10.2 cm?']
    """
    found = []
    for quantity in BENCH_KEYS.values():
        estimate: Estimate | None = getattr(scene, quantity.attribute)
        if estimate is None:
            continue
        value = estimate.value
        usual, effect = _usual(scene, quantity.attribute)
        if not usual[0] <= value <= usual[1]:
            other = other_reading(value, quantity.unit, usual)
            asked = "" if other is None else f": {value:g} {quantity.unit} or {value:g} {other.unit}?"
            decides = other is None or not 1.0 / DECIDING < other.ratio < DECIDING
            beyond = f"is beyond {usual[0]:g} to {usual[1]:g} {quantity.unit}"
            words = f"{value:g} {effect or beyond}{asked}"
            found.append(Slip(quantity.attribute, words, bool(asked), decides))
        if quantity.least > 0.0 and estimate.u >= value:
            wide = f"{value:g} has an uncertainty as large as the value, u = {estimate.u:g}"
            found.append(Slip(quantity.attribute, wide, asks=False, decides=True))
    return tuple(found)


def _usual(scene: Scene, attribute: str) -> tuple[tuple[float, float], str]:
    """Return the usual range of a value next to the mass of its bob, and what a value beyond it would be."""
    bob, low, high = scene.bob_mass_kg, *USUAL.get(attribute, (-math.inf, math.inf))
    if attribute == "disc_diameter_m":
        return (low, high), "is larger than a bench"
    if attribute == "spring_mass_kg" and bob is not None:
        return (0.0, SPRING_BOBS * bob.value), f"is a spring heavier than {SPRING_BOBS:g} bobs"
    if attribute == "spring_constant_n_per_m" and bob is not None:
        softest = bob.value * GRAVITY_M_PER_S2 / LONGEST_RANGE_M
        return (softest, high), f"is a spring that the bob would stretch by more than {LONGEST_RANGE_M:g} m"
    return (low, high), ""
