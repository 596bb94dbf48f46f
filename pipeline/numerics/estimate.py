"""Estimates with uncertainties, single or joint; arithmetic uses the ``uncertainties`` package."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from uncertainties import UFloat, nominal_value, ufloat, umath

from pipeline.numerics.levels import LIMIT
from pipeline.track import F8
from pipeline.units import power_of, product_of

# Share of a value below which its u is left by correlations that cancel, as in period times frequency: hundreds of
# rounding errors of 1.1e-16 each (IEEE 754).
EXPONENT_ROUNDING = 1e-13


class Estimate(UFloat):  # type: ignore[misc]
    """A number of the ``uncertainties`` package that knows its unit; it does not change.

    ``value`` and ``u`` are the number and its standard uncertainty, in ``unit``. Arithmetic and the functions of numpy
    and ``uncertainties.umath`` keep uncertainty and correlations, and those of a copy are those of the original.
    Products and powers keep a unit where it is one of those of results; otherwise it is None. There is no ``float()``,
    which would drop the uncertainty. Two estimates are equal if value, u and unit are.

    Examples
    --------
    >>> period = Estimate(0.7431, 0.0002, "s")
    >>> period, 1 / period, period - period
    (0.74310(20) s, 1.34571(36) 1/s, 0 s)
    >>> period * (1 / period)
    1
    >>> print(2 * period, f"{period:.1uS}", 0.2 * period**-2)
    1.48620 +- 0.00040 s 0.7431(2) 0.36219 +- 0.00019
    >>> print(f"{period.ufloat:.1u}")
    0.7431+/-0.0002
    """

    __slots__ = ("_u", "unit")
    unit: Any  # str, or None where no result has such a unit

    def __init__(self, value: float, u: float | None, unit: str | None = "", *, of: Any = None) -> None:
        """Make an estimate of a variable ``of`` the package; without one it depends on no other.

        ``u`` is the standard uncertainty (coverage factor 1), 0 for an exact value; None takes that of the variable.
        ``unit`` is the SI unit as printed, "" for a ratio.
        """
        of = ufloat(value, u) if of is None and u is not None and u > 0.0 else of
        # The only private name of the package in this project: what makes an estimate depend on the same variables.
        super().__init__(value, of._linear_part if isinstance(of, UFloat) else {})
        self._u, self.unit = u, unit

    @classmethod
    def of_variable(cls, x: Any, unit: str | None, u: float | None = None) -> Estimate:
        """Return a variable of the ``uncertainties`` package or an exact number, with its u if that is known better."""
        return cls(nominal_value(x), u, unit, of=x)

    @property
    def value(self) -> float:
        """The number, in ``unit``."""
        return float(self.nominal_value)

    @property
    def u(self) -> float:
        """The standard uncertainty, in ``unit``."""
        if self._u is None:
            u = float(super().std_dev)
            self._u = 0.0 if u <= EXPONENT_ROUNDING * abs(self.value) else u
        return self._u

    std_dev = s = u

    @property
    def ufloat(self) -> UFloat:
        """The number without its unit, for a package that has units of its own: ``Quantity(x.ufloat, x.unit)``."""
        return UFloat.__pos__(self)

    def written(self, *, brackets: bool = False) -> str:
        """Write the number without its unit: u to two digits, after +- or in units of the last digit in brackets.

        >>> Estimate(0.752857, 0.001429).written(), Estimate(13.98, 0.0).written(), Estimate(1.5e-7, 2e-9).written()
        ('0.7529 +- 0.0014', '13.98', '(1.500 +- 0.020)e-07')
        >>> Estimate(0.752857, 0.001429).written(brackets=True), Estimate(12.3, 1.4).written(brackets=True)
        ('0.7529(14)', '12.3(1.4)')
        """
        value, u = self.value, self.u
        if math.isfinite(value) and u <= 0.0:
            return f"{value:.6g}"
        if not (abs(value) < 1e250 and 1e-250 < u < 1e250):
            return f"{value:g} +- {u:g}"
        return f"{ufloat(value, u):{'.2uS' if brackets else '.2u'}}".replace("+/-", " +- ")

    def __str__(self) -> str:
        return self.written() + self._tail

    def __repr__(self) -> str:
        return self.written(brackets=True) + self._tail

    @property
    def _tail(self) -> str:
        return f" {self.unit}" if self.unit not in (None, "", "1") else ""

    def __format__(self, form: str) -> str:
        return str(super().__format__(form)) if form else str(self)

    def __copy__(self) -> Estimate:
        return self

    def __deepcopy__(self, _: Any) -> Estimate:
        return self  # a copy of its variables would be independent of them

    def __eq__(self, other: object) -> bool:
        if isinstance(other, Estimate):
            return (self.value, self.u, self.unit) == (other.value, other.u, other.unit)
        equal = super().__eq__(other)
        return equal is not NotImplemented and bool(equal)  # None, for example, is no number

    def __bool__(self) -> bool:
        return True  # an estimate is there, also if it is 0: `scene.air_temperature_c or TYPICAL_TEMPERATURE`

    def __ne__(self, other: object) -> bool:
        return not self == other

    def __hash__(self) -> int:
        return hash(self.value)

    def __abs__(self) -> Estimate:
        return self if self.value >= 0.0 else -self

    def __round__(self, digits: int = 0) -> Estimate:
        return Estimate.of_variable(self - (self.value - round(self.value, digits)), self.unit)


def _operator(name: str, unit_of: Callable[[Any, Any], str | None]) -> None:
    """Let an operation on estimates and its reflection return an estimate."""

    def made(method: str, unit_of: Callable[[Any, Any], str | None]) -> Callable[[Any, Any], Any]:
        calculate = getattr(UFloat, method)

        def operate(self: Estimate, other: Any) -> Any:
            x = calculate(self, other)
            return Estimate.of_variable(x, unit_of(self, other)) if isinstance(x, UFloat) else x

        return operate

    setattr(Estimate, f"__{name}__", made(f"__{name}__", unit_of))
    setattr(Estimate, f"__r{name}__", made(f"__r{name}__", lambda right, left: unit_of(left, right)))


def _unit_of(x: Any) -> str | None:
    """Return the unit of an operand; a plain number has none, an array or the package's own number may be anything."""
    return x.unit if isinstance(x, Estimate) else "" if not isinstance(x, UFloat) else None


def _sum(left: Any, right: Any) -> str | None:
    # A sum of many begins with a plain 0.
    units = {_unit_of(x) for x in (left, right) if isinstance(x, UFloat) or x != 0.0}
    return units.pop() if len(units) == 1 else None


def _power(base: Any, exponent: Any) -> str | None:
    if isinstance(exponent, UFloat):
        return "" if _unit_of(base) == _unit_of(exponent) == "" else None
    return power_of(_unit_of(base), exponent)


_operator("add", _sum)
_operator("sub", _sum)
_operator("mul", lambda left, right: product_of(_unit_of(left), _unit_of(right), 1))
_operator("truediv", lambda left, right: product_of(_unit_of(left), _unit_of(right), -1))
_operator("pow", _power)


def _function(name: str, calculate: Callable[[Any], Any], unit_of: Callable[[Any], str | None]) -> None:
    """Give estimates a method, which numpy calls for its function of the same name."""
    setattr(Estimate, name, lambda x: Estimate.of_variable(calculate(x), unit_of(x)))


_function("__neg__", UFloat.__neg__, _unit_of)
_function("__pos__", UFloat.__pos__, _unit_of)
_function("sqrt", umath.sqrt, lambda x: _power(x, 0.5))
_NAMES = "exp expm1 log log10 log1p sin cos tan sinh cosh tanh degrees radians arcsin arccos arctan"
for _name in _NAMES.split():
    _function(_name, getattr(umath, _name.replace("arc", "a")), lambda _: "")


class UpperLimit(Estimate):
    """An estimate of a non-negative quantity that the record does not determine: its u exceeds its value.

    It is written as an upper limit. Its value and its standard uncertainty remain those of the unbounded estimate.

    >>> UpperLimit(0.019, 0.095, "1/(m s)")
    < 0.20 1/(m s) (95 %)
    """

    __slots__ = ()

    @classmethod
    def of(cls, estimate: Estimate) -> Estimate:
        """Return the estimate unchanged if the record determines it, and as an upper limit otherwise."""
        if not estimate.u > abs(estimate.value):
            return estimate
        return cls.of_variable(estimate, estimate.unit, estimate.u)

    @property
    def limit(self) -> float:
        """The value below which the non-negative quantity lies with a probability of 95 %, in ``unit``.

        For a normal distribution with mean x and standard deviation u, truncated at zero, the limit is
        :math:`x + u\\,\\Phi^{-1}(1 - 0.05\\,\\Phi(x/u))`. It is positive for every x. It is never below the one-sided
        limit of the untruncated distribution, so it covers the true value in at least 95 % of runs. S. Navas et al.
        (Particle Data Group), Phys. Rev. D 110 (2024) 030001, section 40.4.1.
        """
        from scipy.special import ndtr, ndtri

        return self.value + self.u * float(ndtri(1.0 - (1.0 - LIMIT) * ndtr(self.value / self.u)))

    def written(self, *, brackets: bool = False) -> str:  # noqa: ARG002  # a limit shows no u
        """Write the limit to two significant digits, rounded up.

        >>> UpperLimit(0.0, 1e-6).written(), UpperLimit(0.019, 0.095).written(brackets=True)
        ('< 2.0e-06', '< 0.20')
        """
        limit = self.limit
        step = 10.0 ** (math.floor(math.log10(limit)) - 1)
        rounded = math.ceil(limit / step - 1e-9) * step
        if not 1e-4 <= rounded < 1e6:
            return f"< {rounded:.1e}"
        return f"< {rounded:.{max(0, 1 - math.floor(math.log10(rounded) + 1e-9))}f}"

    @property
    def _tail(self) -> str:
        return f"{super()._tail} ({100.0 * LIMIT:g} %)"


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """Several parameters estimated together."""

    names: tuple[str, ...]
    values: F8  # (p,)
    covariance: F8  # (p, p) in the products of the parameters' units
    units: tuple[str, ...]

    def __getitem__(self, name: str) -> Estimate:
        """Return one parameter with its marginal standard uncertainty."""
        i = self.names.index(name)
        return Estimate(float(self.values[i]), math.sqrt(max(float(self.covariance[i, i]), 0.0)), self.units[i])

    def estimates(self) -> dict[str, Estimate]:
        """Return every parameter by name."""
        return {name: self[name] for name in self.names}

    @property
    def correlation(self) -> F8:
        """(p, p) float64: correlation coefficients, 1 on the diagonal; 0 between an exact parameter and any other."""
        u = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        scale = np.where(u > 0, u, 1.0)
        found = self.covariance / np.outer(scale, scale)
        np.fill_diagonal(found, 1.0)
        return np.asarray(np.clip(found, -1.0, 1.0))
