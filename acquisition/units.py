"""Units that occur in files, their quantities, and their conversion to SI."""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from acquisition.block import UNITS

LENGTH_POWERS = {"m": 0, "cm": -2, "mm": -3, "um": -6}
"""Units of length, each with the power of ten that converts it to metres."""

_OTHERS = {
    "length": {"in": 0, "ft": 0},
    "angle": {"rad": 0, "mrad": -3, "deg": 0},
    "velocity": {"m/s": 0, "cm/s": -2, "mm/s": -3, "km/h": 0},
    "angular_velocity": {"rad/s": 0, "mrad/s": -3, "deg/s": 0, "rpm": 0},
    "acceleration": {"m/s^2": 0, "cm/s^2": -2, "mm/s^2": -3, "g": 0, "mg": -3},
    "force": {"N": 0, "mN": -3, "kN": 3},
    "voltage": {"V": 0, "mV": -3, "uV": -6, "kV": 3},
    "number": {"1": 0},
}
_FACTORS = {
    **dict.fromkeys(("deg", "deg/s"), math.pi / 180),
    **dict.fromkeys(("g", "mg"), 9.80665),
    "rpm": math.pi / 30,
    "in": 0.0254,
    "ft": 0.3048,
    "km/h": 1 / 3.6,
}
SPELLINGS = {
    "um": ("µm", "μm", "micrometer", "micrometre"),
    "mm": ("millimeter", "millimetre", "milimetro", "millimetri", "毫米"),
    "cm": ("cms", "centimeter", "centimetre", "centimetro", "centimetri", "zentimeter", "厘米"),
    "m": ("meter", "metre", "metro", "metri", "米"),
    "in": ("inch", "inche", "zoll", "pulgada", "polegada", "pouce"),
    "ft": ("feet", "foot"),
    "ns": ("nanosecond", "nano"),
    "us": ("µs", "μs", "usec", "microsecond", "micro", "microsegundo", "mikrosekunde", "mikrosekunden"),
    "ms": ("msec", "millisecond", "milli", "milisegundo", "millisekunde", "millisekunden", "毫秒"),
    "s": ("sec", "seg", "second", "seconde", "sekunde", "sekunden", "segundo", "secondi", "secondo", "秒"),
    "min": ("minute", "minuten", "minuto", "minuti"),
    "h": ("hr", "hour", "stunde", "stunden", "heure", "hora"),
    "d": ("day", "tag", "tage", "jour", "día", "dia", "giorni"),
    "rad": ("radian", "radiant", "rads"),
    "deg": ("°", "º", "degree", "grad"),
    "rpm": ("r/min", "rev/min"),
    "deg/s": ("dps",),
    "V": ("v", "volt"),
    "mV": ("mv", "millivolt"),
    "N": ("newton",),
}
"""Words for units in the singular, in lower case."""
_WORDS = {word: symbol for symbol, words in SPELLINGS.items() for word in words}
_PLAIN = str.maketrans("⁻−²¹·⋅", "--21  ")
_SECONDS = r"(?:s|sec|secs|second|seconds)"
_PER_SECOND = re.compile(
    rf"(?P<what>[^\s/^*.]+)(?:\s+per\s+|\s*/\s*){_SECONDS}(?P<two>\s*(?:\^|\*\*)?\s*2|\s+squared|\s*/\s*{_SECONDS})?"
    r"|(?P<of>[^\s/^*.\d]+?)[\s*.]*s\s*(?:\^|\*\*)?\s*\(?-(?P<power>[12])\)?"
)


class Measure(NamedTuple):
    """The quantity of a unit, and its conversion: ``x * 10**power * factor`` is in the SI unit."""

    quantity: str
    symbol: str
    power: int
    factor: float = 1.0

    @property
    def si(self) -> str:
        """The SI unit of the quantity."""
        return UNITS[self.quantity]


MEASURES = {
    unit: Measure(quantity, unit, power, _FACTORS.get(unit, 1.0))
    for quantity, units in (("length", LENGTH_POWERS), *_OTHERS.items())
    for unit, power in units.items()
}
"""The measure of each unit that a channel may have."""
TIMES = {
    **{unit: Measure("time", unit, power) for unit, power in (("s", 0), ("ms", -3), ("us", -6), ("ns", -9))},
    "min": Measure("time", "min", 0, 60.0),
    "h": Measure("time", "h", 0, 3600.0),
    "d": Measure("time", "d", 0, 86400.0),
}
"""The measure of each unit that times may have."""
NUMBER = MEASURES["1"]


def unit_words(unit: str) -> str:
    """Return the symbol of a spelled-out unit; return other units unchanged."""
    plain = " ".join(unit.split()).strip(".")
    lower = plain.lower()
    if plain in MEASURES:
        return plain
    symbol = _WORDS.get(lower) or _WORDS.get(lower.removesuffix("s")) or _WORDS.get(lower.removesuffix("es"))
    if symbol:
        return symbol
    if (per := _PER_SECOND.fullmatch(lower.translate(_PLAIN))) is not None:
        rate = f"{unit_words(per['what'] or per['of'])}/s" + ("^2" if per["two"] or per["power"] == "2" else "")
        if rate in MEASURES:
            return rate
    return lower if lower in LENGTH_POWERS or lower in TIMES else plain


def measure_of(unit: str) -> Measure | None:
    """Return the measure of a unit; None if no sample can have it."""
    return MEASURES.get(unit_words(unit))


def time_unit(unit: str) -> Measure | None:
    """Return the measure of a unit of time; None for any other text."""
    return TIMES.get(unit_words(unit))
