"""Values with unit and uncertainty, which numpy and the ``uncertainties`` package treat as such."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from uncertainties import UFloat, umath
from uncertainties.core import LinearCombination

from pipeline.numerics.estimate import Estimate, format_value, in_brackets

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
Exponents = tuple[float, ...]


def exponents_of(unit: str) -> Exponents | None:
    """Return the exponents of a unit such as ``1/(m s)``; None for one that is not made of known ones."""
    above, _, below = unit.partition("/")
    total = [0.0] * 5
    for sign, part in ((1, above), (-1, below.strip("()"))):
        for factor in part.split():
            match = re.fullmatch(r"([A-Za-z]+)(?:\^(-?\d+))?", factor)
            if match is None or match[1] not in _BASE:
                if factor != "1":
                    return None
                continue
            for i, power in enumerate(_BASE[match[1]]):
                total[i] += sign * power * int(match[2] or 1)
    return tuple(total)


_NAMES = {found: unit for unit in reversed(_WRITTEN) if (found := exponents_of(unit)) is not None}
_NAMES[(0.0,) * 5] = ""


EXPONENT_ROUNDING = (
    1e-13  # share of the value; a smaller u is left by correlations that cancel, as in period times frequency
)


class Value(UFloat):  # type: ignore[misc]
    """A result: a number with uncertainty of the ``uncertainties`` package that knows its unit.

    ``value`` and ``u`` are the number and its standard uncertainty, in ``unit``. Arithmetic and the functions of numpy
    and ``uncertainties.umath`` keep uncertainty and correlations. Products and powers keep a unit where it is one of
    those of results; otherwise they have none. It has no ``float()``, which would drop the uncertainty.

    Examples
    --------
    >>> period = Value.of(Estimate(0.7431, 0.0002, "s"))
    >>> period, 1 / period, period - period
    (0.74310(20) s, 1.34571(36) 1/s, 0 s)
    >>> period * (1 / period)
    1
    >>> print(2 * period, f"{period:.1uS}", 0.2 * period**-2)
    1.48620 +- 0.00040 s 0.7431(2) 0.36219 +- 0.00019
    >>> print(f"{period.ufloat:.1u}")
    0.7431+/-0.0002
    """

    __slots__ = ("_shown", "unit")

    def __init__(self, number: Any, unit: str | None = "", shown: tuple[str, str] | None = None) -> None:
        part = number._linear_part if isinstance(number, UFloat) else LinearCombination({})
        super().__init__(getattr(number, "nominal_value", number), part)
        self.unit, self._shown = unit, shown

    @classmethod
    def of(cls, estimate: Estimate) -> Value:
        """Return an estimate as a value, with the text of the estimate."""
        number = estimate.ufloat
        if isinstance(number, UFloat) and hasattr(number, "_std_dev"):
            number = number + 0.0  # a variable becomes a function of itself
        return cls(number, estimate.unit, (str(estimate), repr(estimate)))

    @property
    def value(self) -> float:
        """The number, in ``unit``."""
        return float(self.nominal_value)

    @property
    def u(self) -> float:
        """The standard uncertainty, in ``unit``."""
        return float(self.std_dev)

    @property
    def ufloat(self) -> UFloat:
        """The number without its unit, for a package that has units of its own: ``Quantity(x.ufloat, x.unit)``."""
        return UFloat(self.nominal_value, self._linear_part)

    def __str__(self) -> str:
        return self._shown[0] if self._shown else self._written(format_value)

    def __repr__(self) -> str:
        return self._shown[1] if self._shown else self._written(in_brackets)

    def _written(self, write: Callable[[float, float, str], str]) -> str:
        exact = self.u <= EXPONENT_ROUNDING * abs(self.value)
        return write(self.value, 0.0 if exact else self.u, self.unit or "")

    def __copy__(self) -> Value:
        return self

    def __deepcopy__(self, _: Any) -> Value:
        return self  # nothing of a value changes, and a copy of its variables would be independent of them

    def __abs__(self) -> Value:
        return self if self.value >= 0.0 else -self

    def __round__(self, digits: int = 0) -> Value:
        return Value(self - (self.value - round(self.value, digits)), self.unit)

    def __lt__(self, other: Any) -> bool:
        return self.value < _number(other)

    def __le__(self, other: Any) -> bool:
        return self.value <= _number(other)

    def __gt__(self, other: Any) -> bool:
        return self.value > _number(other)

    def __ge__(self, other: Any) -> bool:
        return self.value >= _number(other)

    def __format__(self, form: str) -> str:
        return str(super().__format__(form)) if form else str(self)


def _number(other: Any) -> float:
    return float(getattr(other, "nominal_value", other))


def _unit_of(other: Any) -> str | None:
    return getattr(other, "unit", "")


def _unit(name: str, left: Any, right: Any) -> str | None:
    """Return the unit of a sum, a product or a power; None if results have no such unit."""
    units = _unit_of(left), _unit_of(right)
    if name in ("add", "sub"):
        return units[0] if units[0] == units[1] else None
    if name == "pow" and isinstance(right, UFloat):
        return "" if units == ("", "") else None
    left_powers, right_powers = (None if unit is None else exponents_of(unit) for unit in units)
    if left_powers is None or right_powers is None:
        return None
    if name == "pow":
        return _NAMES.get(tuple(power * float(right) for power in left_powers))
    sign = 1 if name == "mul" else -1
    return _NAMES.get(tuple(a + sign * b for a, b in zip(left_powers, right_powers, strict=True)))


def _operator(name: str, reflected: bool) -> Callable[[Any, Any], Any]:
    method = getattr(UFloat, f"__{'r' * reflected}{name}__")

    def operate(self: Value, other: Any) -> Any:
        number = method(self, other)
        left, right = (other, self) if reflected else (self, other)
        return Value(number, _unit(name, left, right)) if isinstance(number, UFloat) else number

    return operate


for _name in ("add", "sub", "mul", "truediv", "pow"):
    for _reflected in (False, True):
        setattr(Value, f"__{'r' * _reflected}{_name}__", _operator(_name, _reflected))


def _unary(function: Callable[[Any], Any], unit: Callable[[Any], str | None]) -> Callable[[Value], Any]:
    def apply(self: Value) -> Any:
        return Value(function(self), unit(self))

    return apply


for _name in ("__neg__", "__pos__"):
    setattr(Value, _name, _unary(getattr(UFloat, _name), _unit_of))
Value.sqrt = _unary(umath.sqrt, lambda x: _unit("pow", x, 0.5))
# numpy calls the method of this name of an object; the result is a number without unit.
_OTHERWISE_IN_UMATH = {"arcsin": "asin", "arccos": "acos", "arctan": "atan"}
_SAME = ["exp", "expm1", "log", "log10", "log1p", "sin", "cos", "tan", "sinh", "cosh", "tanh", "degrees", "radians"]
for _name in (*_SAME, *_OTHERWISE_IN_UMATH):
    setattr(Value, _name, _unary(getattr(umath, _OTHERWISE_IN_UMATH.get(_name, _name)), lambda _: ""))
