"""Names and units of the values in a record: stages calculate in its unit, sentences and figures state the unit."""

from __future__ import annotations

import re
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Shown:
    """Name and display unit of the values in one unit.

    Parameters
    ----------
    noun : str
        Name of one value.
    unit : str
        Unit in which sentences and figures write the value.
    factor : float
        Factor from the record's unit to ``unit``.
    """

    noun: str
    unit: str
    factor: float


SHOWN = {
    "m": Shown("distance", "mm", 1e3),
    "rad": Shown("angle", "rad", 1.0),
    "m/s": Shown("velocity", "m/s", 1.0),
    "rad/s": Shown("angular velocity", "rad/s", 1.0),
    "m/s^2": Shown("acceleration", "m/s^2", 1.0),
    "N": Shown("force", "N", 1.0),
    "V": Shown("voltage", "V", 1.0),
    "1": Shown("value", "", 1.0),
}
"""Names and display units by the units of :data:`pipeline.track.UNITS`."""

_SIMPLER = {
    "m/s": {"m/s": "m/s^2", "m/s^2": "m/s^3", "1/(m s)": "1/m"},
    "rad/s": {"m/s": "rad/s^2", "m/s^2": "rad/s^3", "1/(m s)": "1/rad"},
    "m/s^2": {"m/s": "m/s^3", "m/s^2": "m/s^4", "1/(m s)": "s/m"},
    "1": {"m/s": "1/s", "m/s^2": "1/s^2", "1/(m s)": "1/s", "m^(1-n)/s": "1/s"},
}
"""Simplified units where powers of s or all of m cancel, by the record's unit and the unit written for metres."""


def amount(value: float, unit: str, form: str = ".2g") -> str:
    """Write a value of a record with its unit.

    Parameters
    ----------
    value : float
        Value, in ``unit``.
    unit : str
        Unit of the record.
    form : str
        Format of the number in mm. In other units, where typical sizes are unknown, four significant digits replace
        a fixed number of decimals.

    Examples
    --------
    >>> amount(0.00234, "m"), amount(0.0234, "rad"), amount(1.2345678, "V", ".1f")
    ('2.3 mm', '0.023 rad', '1.235 V')
    """
    shown = SHOWN[unit]
    if unit != "m" and form.endswith("f"):
        form = ".4g"
    return f"{value * shown.factor:{form}} {shown.unit}".rstrip()


def noun(unit: str) -> str:
    """Return the noun for a value of a record in this unit."""
    return SHOWN[unit].noun


def plural(unit: str) -> str:
    """Return the plural noun for values of a record in this unit.

    Examples
    --------
    >>> plural("m"), plural("rad/s")
    ('distances', 'angular velocities')
    """
    own = SHOWN[unit].noun
    return f"{own[:-1]}ies" if own.endswith("y") else f"{own}s"


def in_unit(form: str, unit: str) -> str:
    """Convert a unit that was written for records in metres to a record in another unit.

    Examples
    --------
    >>> in_unit("1/(m s)", "V"), in_unit("m/s", "rad"), in_unit("1/(m s)", "m/s^2"), in_unit("1/s", "N")
    ('1/(V s)', 'rad/s', 's/m', '1/s')
    >>> in_unit("m^(1-n)/s", "rad/s"), in_unit("rad/(s m^2)", "1")
    ('(rad/s)^(1-n)/s', 'rad/s')
    """
    if form == "m":
        return unit
    if form in _SIMPLER.get(unit, {}):
        return _SIMPLER[unit][form]
    if unit == "1":
        return re.sub(r"\(s m\b[^)]*\)", "s", form)
    return re.sub(r"\bm\b", f"({unit})" if "/" in unit else unit, form)
