"""A value as a person types it, in the unit that a scale or a barometer shows: 217.6 g, 10.2 cm, 1005 hPa, 21 °C."""

from __future__ import annotations

import re
from typing import NamedTuple

from pipeline.bench.air import ZERO_CELSIUS_K
from pipeline.numerics.estimate import Estimate


class Scale(NamedTuple):
    """What a unit is in SI: ``factor`` times the number, plus ``zero``."""

    factor: float
    zero: float


# Pound, inch and atmosphere are exact by definition; the pressure of mercury is that of NIST SP 811, appendix B.
_FACTORS = {
    "kg": {"kg": 1.0, "g": 1e-3, "mg": 1e-6, "lb": 0.45359237, "oz": 0.45359237 / 16},
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "ft": 0.3048},
    "N/m": {"N/m": 1.0, "N/cm": 1e2, "N/mm": 1e3, "mN/mm": 1.0, "mN/m": 1e-3},
    "degC": {"degC": 1.0, "C": 1.0, "K": 1.0, "degF": 5.0 / 9.0, "F": 5.0 / 9.0},
    "Pa": {"Pa": 1.0, "hPa": 1e2, "mbar": 1e2, "kPa": 1e3, "bar": 1e5}
    | {"mmHg": 133.3224, "Torr": 101325.0 / 760.0, "inHg": 3386.389, "atm": 101325.0},
    "": {"%": 1e-2},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
    "m/s": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3},
}
_ZEROS = {"K": -ZERO_CELSIUS_K, "degF": -160.0 / 9.0, "F": -160.0 / 9.0}
_NO_NUMBER = "must be a number, with its standard uncertainty as 0.2007+/-0.0001 or 0.2007(1)"
_SIGNS = str.maketrans({"\u2212": "-", "\u2013": "-", "µ": "u", "μ": "u", "\u00a0": " ", "\u202f": " "})
_FLOAT = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_UNIT_TWICE = re.compile(rf"({_FLOAT})\s*(?![eE][-+]?\d)([^\s\d.()+-]\S*?)\s*(?:\+/-|\+-|±)\s*({_FLOAT})\s*\2")
_TYPED = re.compile(rf"(\(?\s*{_FLOAT}(?:\(\d*\.?\d+\))?(?:\s*(?:\+/-|\+-|±)\s*{_FLOAT})?\s*\)?)\s*(\S.*)?")


def scales_of(unit: str) -> dict[str, Scale]:
    """Return the units in which a value of this unit may be typed; without any of its own, it is the only one."""
    return {name: Scale(factor, _ZEROS.get(name, 0.0)) for name, factor in _FACTORS.get(unit, {unit: 1.0}).items()}


def typed(text: str, unit: str) -> Estimate:
    """Return the value that was typed, in this unit; without a unit of its own it is in this unit.

    Raises
    ------
    ValueError
        If the text is no number, or its unit is none of :func:`scales_of`.

    Examples
    --------
    >>> typed("217.6 g", "kg"), typed("10.2 cm ± 0.1 cm", "m"), typed("1005(1) hPa", "Pa"), typed("21 °C", "degC")
    (0.2176 kg, 0.1020(10) m, 1.0050(10)e+05 Pa, 21 degC)
    """
    from uncertainties import ufloat_fromstr
    from uncertainties.core import NegativeStdDev

    text = _UNIT_TWICE.sub(r"\1+/-\3 \2", text.translate(_SIGNS).strip())
    match = _TYPED.fullmatch(text)
    if match is None:
        raise ValueError(_NO_NUMBER)
    if (match[2] or "").startswith(","):
        raise ValueError("must be a number with a decimal point and not a comma")
    number, own = match[1], (match[2] or "").replace("°", "").replace(" ", "")
    scales = {name.replace(" ", ""): scale for name, scale in scales_of(unit).items()} | {"": Scale(1.0, 0.0)}
    if own not in scales:
        raise ValueError(f"must have one of the units {', '.join(scales_of(unit))}")
    scale = scales[own]
    try:
        value, u = float(number), 0.0  # a number alone is exact, while the library takes its last digit for uncertain
    except ValueError:
        try:
            measured = ufloat_fromstr(number)
        except (ValueError, NegativeStdDev):
            raise ValueError(_NO_NUMBER) from None
        value, u = measured.nominal_value, measured.std_dev
    # Rounded to the digits of a float, so that 217.6 g is the number 0.2176 and not 0.21760000000000002.
    return Estimate(float(f"{value * scale.factor + scale.zero:.15g}"), float(f"{u * scale.factor:.15g}"), unit)


class UnitReading(NamedTuple):
    """A unit in which a bare number may have been read off, and how many times larger the value then is."""

    unit: str
    ratio: float


def other_reading(value: float, unit: str, usual: tuple[float, float]) -> UnitReading | None:
    """Return the other unit in which the bare number would be a usual value, that of a bench first; None without any.

    >>> other_reading(10.2, "m", (0.0, 1.0)).unit, other_reading(1005.0, "Pa", (5e4, 1.1e5)).unit
    ('cm', 'hPa')
    >>> other_reading(294.15, "degC", (-30.0, 50.0)).unit
    'K'
    """
    within = [
        UnitReading(name, (scale.factor * value + scale.zero) / value)
        for name, scale in scales_of(unit).items()
        if value and name != unit and usual[0] <= scale.factor * value + scale.zero <= usual[1]
    ]
    return min(within, key=lambda each: each.unit not in ("g", "cm", "hPa", "K"), default=None)
