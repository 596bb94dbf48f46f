"""Names and units of the values in a record: stages calculate in its unit, sentences and figures state the unit."""

from __future__ import annotations

import re
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from functools import cache


@dataclass(frozen=True, slots=True)
class RecordedUnit:
    """What a record in one unit contains, and how sentences and figures show it."""

    quantity: str  # as `acquisition.block.UNITS` has it (a test compares them)
    noun: str  # name of one value
    unit: str  # unit in which sentences and figures write the value
    factor: float = 1.0  # factor from the record's unit to ``unit``


RECORDED_UNITS = {
    "m": RecordedUnit("length", "distance", "mm", 1e3),
    "rad": RecordedUnit("angle", "angle", "rad"),
    "m/s": RecordedUnit("velocity", "velocity", "m/s"),
    "rad/s": RecordedUnit("angular_velocity", "angular velocity", "rad/s"),
    "m/s^2": RecordedUnit("acceleration", "acceleration", "m/s^2"),
    "N": RecordedUnit("force", "force", "N"),
    "V": RecordedUnit("voltage", "voltage", "V"),
    "1": RecordedUnit("number", "value", ""),
}
"""The SI units that a track may have."""


@dataclass(frozen=True, slots=True)
class Unit:
    """The exponents of metre, second and radian in a unit.

    ``less`` names a parameter whose value is subtracted from the exponent of the metre: "n" for c in :math:`c A^n`.

    Examples
    --------
    >>> print(Unit(1, -1), Unit(-0.5, -1), Unit(1, -1, less="n"), Unit(-1), sep=", ")
    m/s, 1/(m^1/2 s), m^(1-n)/s, 1/m
    """

    metre: float = 0.0
    second: float = 0.0
    less: str = ""
    radian: float = 0.0

    def __str__(self) -> str:
        return self.of("m")

    def of(self, unit: str) -> str:
        """Write the unit for a recording whose values have this unit in place of the metre.

        >>> Unit(-1, -1).of("V"), Unit(1, -1).of("rad"), Unit(-1, -1).of("m/s^2"), Unit(0, -1).of("N"), Unit(1).of("1")
        ('1/(V s)', 'rad/s', 's/m', '1/s', '1')
        >>> Unit(1, -1, less="n").of("rad/s"), Unit(-2, -1, radian=1).of("1")
        ('(rad/s)^(1-n)/s', 'rad/s')
        """
        return _of(self, unit)


@cache
def _of(each: Unit, unit: str) -> str:
    symbol, _, divisor = unit.partition("/")
    powers, above, below = {"rad": each.radian}, list[str](), list[str]()
    seconds = each.second
    if unit != "1" and each.less:
        above.append(f"{f'({unit})' if divisor else unit}^({each.metre:g}-{each.less})")
    elif unit != "1":
        powers[symbol] = powers.get(symbol, 0.0) + each.metre
        seconds -= each.metre * {"": 0.0, "s": 1.0, "s^2": 2.0}[divisor]
    for name, exponent in (powers | {"s": seconds}).items():
        size = Fraction(abs(exponent)).limit_denominator(1000)
        if exponent:
            (above if exponent > 0.0 else below).append(name if size == 1 else f"{name}^{size}")
    if not below:
        return " ".join(above) or ("1" if each.metre else "")
    divided_by = below[0] if len(below) == 1 else f"({' '.join(below)})"
    return f"{' '.join(above) or '1'}/{divided_by}"


# Exponents of kilogram, metre, second, radian and volt in each unit that results have.
_BASE = {
    "kg": (1, 0, 0, 0, 0),
    "m": (0, 1, 0, 0, 0),
    "s": (0, 0, 1, 0, 0),
    "rad": (0, 0, 0, 1, 0),
    "V": (0, 0, 0, 0, 1),
    "N": (1, 1, -2, 0, 0),
    "J": (1, 2, -2, 0, 0),
    "Hz": (0, 0, -1, 0, 0),
    "Pa": (1, -1, -2, 0, 0),
}
# Units in which products and powers are written, the first of each dimension.
_WRITTEN = (
    "kg", "m", "s", "rad", "V", "N", "J", "1/s", "N/m", "m/s", "m/s^2", "rad/s", "m^2", "s^2", "1/m", "1/(m s)",
    "1/(rad s)", "J/kg", "kg m^2", "N s", "m^2/s", "V/s", "1/(V s)", "Pa",
)  # fmt: skip


def _exponents(unit: str | None) -> tuple[float, ...] | None:
    """Return the exponents of a unit such as ``1/(m s)``; None for one that is not made of known ones."""
    if unit is None:
        return None
    above, _, below = unit.partition("/")
    total = [0.0] * 5
    for sign, part in ((1, above), (-1, below.strip("()"))):
        for factor in filter(lambda factor: factor != "1", part.split()):
            match = re.fullmatch(r"([A-Za-z]+)(?:\^(-?\d+))?", factor)
            if match is None or match[1] not in _BASE:
                return None
            for i, exponent in enumerate(_BASE[match[1]]):
                total[i] += sign * exponent * int(match[2] or 1)
    return tuple(total)


_NAMES = {found: unit for unit in reversed(_WRITTEN) if (found := _exponents(unit)) is not None}
_NAMES[(0.0,) * 5] = ""


def product_of(left: str | None, right: str | None, power: int) -> str | None:
    """Return the unit of a product with a power of another; None if results have no such unit.

    >>> product_of("N/m", "s^2", 1), product_of("m", "s", -1), product_of("N", "s^2", -1)
    ('kg', 'm/s', None)
    """
    of_left, of_right = _exponents(left), _exponents(right)
    if of_left is None or of_right is None:
        return None
    return _NAMES.get(tuple(a + power * b for a, b in zip(of_left, of_right, strict=True)))


def power_of(unit: str | None, exponent: float) -> str | None:
    """Return the unit of a power; None if results have no such unit.

    >>> power_of("s", -1), power_of("m^2", 0.5), power_of("kg", 2)
    ('1/s', 'm', None)
    """
    powers = _exponents(unit)
    return None if powers is None else _NAMES.get(tuple(float(exponent) * each for each in powers))


def number(value: float, form: str = "") -> str:
    """Write a number, by default an integer or three significant digits, without an exponent if it has a usual size.

    >>> number(12172), number(5.98123), number(23164.2), number(140, ".2g"), number(3e-5, ".1g"), number(1e-9)
    ('12,172', '5.98', '23,200', '140', '0.00003', '1e-09')
    """
    if not form and value % 1 == 0.0 and abs(value) < 1e6:
        return f"{value:,.0f}" if abs(value) >= 1e4 else f"{value:.0f}"
    text = f"{value:{form or '.3g'}}"
    return f"{Decimal(text):{'+' * ('+' in form)},f}" if "e" in text and 1e-6 <= abs(value) < 1e9 else text


def amount(value: float, unit: str, form: str = ".2g") -> str:
    """Write a value of a recording with its unit; a length in mm, or in m from one metre on.

    In other units than m, where typical sizes are unknown, four digits replace a fixed number of decimals.

    >>> amount(0.00234, "m"), amount(23.945, "m", ".4g"), amount(0.0234, "rad"), amount(1.2345678, "V", ".1f")
    ('2.3 mm', '23.95 m', '0.023 rad', '1.235 V')
    """
    shown = RECORDED_UNITS[unit]
    if unit == "m" and abs(value) >= 1.0:
        return f"{number(value, form if form.endswith('g') else '.4g')} m"
    if unit != "m" and form.endswith("f"):
        form = ".4g"
    return f"{number(value * shown.factor, form)} {shown.unit}".rstrip()


def noun(unit: str) -> str:
    """Return the noun for a value of a record in this unit."""
    return RECORDED_UNITS[unit].noun


def plural(unit: str) -> str:
    """Return the plural noun for values of a record in this unit.

    >>> plural("m"), plural("rad/s")
    ('distances', 'angular velocities')
    """
    own = RECORDED_UNITS[unit].noun
    return f"{own[:-1]}ies" if own.endswith("y") else f"{own}s"
