"""Units as files print them: what they are units of, and what makes them SI."""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from acquisition.block import UNITS

__all__ = ["LENGTHS", "TIMES", "Measure", "known_units", "length_power", "measure_of", "time_power", "unit_words"]

LENGTHS = {"m": 0, "cm": -2, "mm": -3, "um": -6}
"""Lengths by the power of ten that makes them metres."""
TIMES = {"s": 0, "ms": -3, "us": -6, "ns": -9, "min": 0}
"""Times by the power of ten that makes them seconds; of minutes :data:`MINUTE_S` more."""

_OTHERS = {
    "angle": {"rad": 0, "mrad": -3, "deg": 0},
    "voltage": {"V": 0, "mV": -3, "uV": -6, "kV": 3},
    "acceleration": {"m/s^2": 0, "cm/s^2": -2, "mm/s^2": -3},
    "force": {"N": 0, "mN": -3, "kN": 3},
}
_FACTORS = {"deg": math.pi / 180}
_SPELLINGS = {
    "um": ("µm", "μm", "micrometer", "micrometre"),
    "mm": ("millimeter", "millimetre", "毫米"),
    "cm": ("centimeter", "centimetre", "厘米"),
    "m": ("meter", "metre", "metri", "米"),
    "us": ("µs", "μs", "microsecond"),
    "ms": ("msec", "millisecond", "毫秒"),
    "s": ("sec", "second", "seconde", "sekunde", "sekunden", "segundo", "secondi", "secondo", "秒"),
    "min": ("minute", "minuten", "minuto", "minuti"),
    "rad": ("radian", "radiant"),
    "deg": ("°", "degree"),
    "V": ("v", "volt"),
    "mV": ("mv", "millivolt"),
    "m/s^2": ("m/s²", "m/s2", "m/s**2", "m/s/s", "ms^-2", "m s^-2"),
    "N": ("newton",),
}
_WORDS = {word: symbol for symbol, words in _SPELLINGS.items() for word in words}
_SQUARE = re.compile(r"(?:\^|\*\*)?2|²")


class Measure(NamedTuple):
    """What a unit is of: ``x * 10**power * factor`` of it is SI."""

    quantity: str
    symbol: str
    power: int
    factor: float = 1.0

    @property
    def si(self) -> str:
        """The quantity's one SI unit."""
        return UNITS[self.quantity]


_MEASURES = {
    unit: Measure(quantity, unit, power, _FACTORS.get(unit, 1.0))
    for quantity, units in {"length": LENGTHS, **_OTHERS}.items()
    for unit, power in units.items()
}


def known_units() -> str:
    """Return the units that a channel may be given in, listed for a message."""
    return ", ".join(_MEASURES)


def unit_words(unit: str) -> str:
    """Return a unit's symbol where it is spelled out; else as it is.

    Examples
    --------
    >>> unit_words(" centimeters "), unit_words("m/s2"), unit_words("V")
    ('cm', 'm/s^2', 'V')
    """
    plain = " ".join(unit.split()).strip(".")
    lower = plain.lower()
    if plain in _MEASURES:
        return plain
    found = _WORDS.get(lower) or _WORDS.get(lower.removesuffix("s")) or _WORDS.get(lower.removesuffix("es"))
    if found:
        return found
    if "/s" in lower and (squared := _SQUARE.sub("^2", lower)) in _MEASURES:
        return squared
    return lower if lower in LENGTHS or lower in TIMES else plain


def measure_of(unit: str) -> Measure | None:
    """Return what a unit is of; None where it is of nothing that a sample may be.

    Examples
    --------
    >>> measure_of("mm"), measure_of("Volts").quantity, measure_of("Hz")
    (Measure(quantity='length', symbol='mm', power=-3, factor=1.0), 'voltage', None)
    """
    return _MEASURES.get(unit_words(unit))


def length_power(unit: str) -> int | None:
    """Return the power of ten that makes a length metres; None for what is no length.

    Examples
    --------
    >>> length_power("cm"), length_power("V")
    (-2, None)
    """
    return LENGTHS.get(unit_words(unit))


def time_power(unit: str) -> int | None:
    """Return the power of ten that makes a time seconds; None for what is no time."""
    return TIMES.get(unit_words(unit))
