"""Numbers with their uncertainties, alone and jointly."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pipeline.track import F8

__all__ = ["Estimate", "Joint", "format_value"]


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value with its standard uncertainty.

    Parameters
    ----------
    value : float
        In ``unit``.
    u : float
        Standard uncertainty (k = 1), in ``unit``; 0 where the value is taken as exact.
    unit : str
        SI unit as printed, "" for a ratio.
    """

    value: float
    u: float
    unit: str = ""

    def __str__(self) -> str:
        return format_value(self.value, self.u, self.unit)


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """Several parameters estimated together.

    Parameters
    ----------
    names : tuple of str
    values : (p,) float64
    covariance : (p, p) float64
        In the products of the parameters' units.
    units : tuple of str
    """

    names: tuple[str, ...]
    values: F8
    covariance: F8
    units: tuple[str, ...]

    def __getitem__(self, name: str) -> Estimate:
        """Return one parameter with its marginal standard uncertainty."""
        i = self.names.index(name)
        return Estimate(float(self.values[i]), math.sqrt(max(float(self.covariance[i, i]), 0.0)), self.units[i])

    def estimates(self) -> dict[str, Estimate]:
        """Return every parameter by name."""
        return {name: self[name] for name in self.names}


def format_value(value: float, u: float, unit: str = "") -> str:
    """Write a value to the digits that its uncertainty allows: two digits of u, the value to match.

    Examples
    --------
    >>> format_value(0.752857, 0.001429, "s")
    '0.7529 +- 0.0014 s'
    >>> format_value(13.98, 0.0, "N/m")
    '13.98 N/m'
    >>> format_value(1.5e-7, 2.0e-9, "m")
    '(1.500 +- 0.020)e-07 m'
    """
    tail = f" {unit}" if unit else ""
    if not math.isfinite(value) or not math.isfinite(u):
        return f"{value:g} +- {u:g}{tail}"
    if u <= 0:
        return f"{value:.6g}{tail}"
    # The exponent that u has once it is rounded to two digits: 0.0999 is 0.10, not 0.0999.
    exponent = int(f"{u:.1e}".split("e")[1])
    scale = max(abs(value), u)
    if not 1e-4 <= scale < 1e6:
        power = math.floor(math.log10(scale))
        digits = max(0, power - exponent + 1)
        return f"({value / 10.0**power:.{digits}f} +- {u / 10.0**power:.{digits}f})e{power:+03d}{tail}"
    digits = max(0, 1 - exponent)
    if exponent > 1:
        step = 10.0 ** (exponent - 1)
        return f"{round(value / step) * step:.0f} +- {round(u / step) * step:.0f}{tail}"
    return f"{value:.{digits}f} +- {u:.{digits}f}{tail}"
