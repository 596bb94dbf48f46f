"""Units as files print them: which are lengths, which are times, and the power of ten to SI."""

from __future__ import annotations

__all__ = ["LENGTHS", "TIMES", "length_power", "time_power", "unit_words"]

LENGTHS = {"m": 0, "cm": -2, "mm": -3, "um": -6}
"""Lengths by the power of ten that makes them metres."""
TIMES = {"s": 0, "ms": -3, "us": -6}
"""Times by the power of ten that makes them seconds."""

_SPELLINGS = {
    "um": ("µm", "μm", "micrometer", "micrometre"),
    "mm": ("millimeter", "millimetre", "毫米"),
    "cm": ("centimeter", "centimetre", "厘米"),
    "m": ("meter", "metre", "metri", "米"),
    "us": ("µs", "μs", "microsecond"),
    "ms": ("msec", "millisecond", "毫秒"),
    "s": ("sec", "second", "seconde", "sekunde", "sekunden", "segundo", "secondi", "secondo", "秒"),
}
_WORDS = {word: symbol for symbol, words in _SPELLINGS.items() for word in words}


def unit_words(unit: str) -> str:
    """Return a unit's symbol where it is spelled out; else as it is.

    Examples
    --------
    >>> unit_words(" centimeters "), unit_words("m/s^2")
    ('cm', 'm/s^2')
    """
    plain = " ".join(unit.split()).strip(".")
    lower = plain.lower()
    found = _WORDS.get(lower) or _WORDS.get(lower.removesuffix("s"))
    if found:
        return found
    return lower if lower in LENGTHS or lower in TIMES else plain


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
