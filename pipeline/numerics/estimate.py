"""Estimates with uncertainties, single or joint; arithmetic uses the ``uncertainties`` package."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pipeline.numerics.levels import LIMIT
from pipeline.track import F8


def _both_ways(operation: Callable[[Any, Any], Any]) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return an operation on an estimate and another number, and that with the two exchanged."""

    def forwards(estimate: Estimate, other: Any) -> Any:
        return operation(estimate.ufloat, other.ufloat if isinstance(other, Estimate) else other)

    def backwards(estimate: Estimate, other: Any) -> Any:
        return operation(other, estimate.ufloat)

    return forwards, backwards


@dataclass(frozen=True, slots=True, repr=False)
class Estimate:
    """A value with its standard uncertainty; it can be used in calculations like a number.

    Results of arithmetic are :class:`uncertainties.UFloat` in SI units, or plain numbers where nothing is uncertain.
    Estimates of one analysis record which variables they depend on, so that their correlations are kept.

    >>> period = Estimate(0.7431, 0.0002, "s")
    >>> period
    0.74310(20) s
    >>> 2 * period, period - period, float(period)
    (1.4862+/-0.0004, 0.0+/-0, 0.7431)
    """

    value: float  # in ``unit``
    u: float  # standard uncertainty (coverage factor 1); 0 for a value that is taken as exact
    unit: str = ""  # SI unit as printed, "" for a ratio
    # The ``uncertainties.UFloat`` that the estimate was calculated from; without one it depends on no other. It is not
    # passed on by ``dataclasses.replace``, whose result is another quantity.
    variable: Any = field(default=None, compare=False, init=False)

    @classmethod
    def of_variable(cls, x: Any, unit: str, u: float | None = None) -> Estimate:
        """Return a variable of the ``uncertainties`` package or an exact number, with its u if that is known better."""
        from uncertainties import nominal_value, std_dev

        estimate = cls(float(nominal_value(x)), float(std_dev(x)) if u is None else u, unit)
        object.__setattr__(estimate, "variable", x)
        return estimate

    @property
    def ufloat(self) -> Any:
        """The estimate for calculations: an ``uncertainties.UFloat``, or the bare value if it is exact."""
        if self.variable is None:
            from uncertainties import ufloat

            # Cached, so that an estimate is always the same variable: x - x is 0 and not 0 +- 1.4 u.
            object.__setattr__(self, "variable", ufloat(self.value, self.u) if self.u > 0 else self.value)
        return self.variable

    def __str__(self) -> str:
        return format_value(self.value, self.u, self.unit)

    def __repr__(self) -> str:
        return in_brackets(self.value, self.u, self.unit)

    def __format__(self, spec: str) -> str:
        return format(self.ufloat, spec) if spec else str(self)

    def __float__(self) -> float:
        return self.value

    __add__, __radd__ = _both_ways(operator.add)
    __sub__, __rsub__ = _both_ways(operator.sub)
    __mul__, __rmul__ = _both_ways(operator.mul)
    __truediv__, __rtruediv__ = _both_ways(operator.truediv)
    __pow__, __rpow__ = _both_ways(operator.pow)

    def __neg__(self) -> Any:
        return -self.ufloat


@dataclass(frozen=True, slots=True, repr=False)
class UpperLimit(Estimate):
    """An estimate of a non-negative quantity that the record does not determine: its u exceeds its value.

    It is written as an upper limit. Its value and its standard uncertainty remain those of the unbounded estimate.

    >>> UpperLimit(0.019, 0.095, "1/(m s)")
    < 0.20 1/(m s) (95 %)
    """

    @classmethod
    def of(cls, estimate: Estimate) -> Estimate:
        """Return the estimate unchanged if the record determines it, and as an upper limit otherwise."""
        if not estimate.u > abs(estimate.value):
            return estimate
        return cls.of_variable(estimate.ufloat, estimate.unit, estimate.u)

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

    def __str__(self) -> str:
        return f"< {format_limit(self.limit)} {self.unit}".rstrip() + f" ({100.0 * LIMIT:g} %)"

    def __repr__(self) -> str:
        return str(self)


def format_limit(limit: float) -> str:
    """Write a positive upper limit to two significant digits, rounded up.

    >>> format_limit(0.1991), format_limit(1.21e-6)
    ('0.20', '1.3e-06')
    """
    exponent = math.floor(math.log10(limit))
    step = 10.0 ** (exponent - 1)
    rounded = math.ceil(limit / step - 1e-9) * step
    if not 1e-4 <= rounded < 1e6:
        return f"{rounded:.1e}"
    return f"{rounded:.{max(0, 1 - math.floor(math.log10(rounded) + 1e-9))}f}"


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


def format_value(value: float, u: float, unit: str = "") -> str:
    """Write u to two significant digits and the value to the same decimal place.

    >>> format_value(0.752857, 0.001429, "s"), format_value(13.98, 0.0, "N/m"), format_value(1.5e-7, 2.0e-9, "m")
    ('0.7529 +- 0.0014 s', '13.98 N/m', '(1.500 +- 0.020)e-07 m')
    """
    return _written(value, u, ".2u", unit)


def in_brackets(value: float, u: float, unit: str = "") -> str:
    """Write the uncertainty in brackets, in units of the value's last digit.

    >>> in_brackets(0.752857, 0.001429, "s"), in_brackets(12.3, 1.4), in_brackets(1.5e-7, 2.0e-9, "m")
    ('0.7529(14) s', '12.3(1.4)', '1.500(20)e-07 m')
    """
    return _written(value, u, ".2uS", unit)


def _written(value: float, u: float, form: str, unit: str) -> str:
    tail = f" {unit}" if unit not in ("", "1") else ""
    if math.isfinite(value) and u <= 0.0:
        return f"{value:.6g}{tail}"
    if not (abs(value) < 1e250 and 1e-250 < u < 1e250):
        return f"{value:g} +- {u:g}{tail}"
    from uncertainties import ufloat

    return f"{ufloat(value, u):{form}}{tail}".replace("+/-", " +- ")
