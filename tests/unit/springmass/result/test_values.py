"""Values keep uncertainty, correlation and unit in numpy and in the ``uncertainties`` package."""

from __future__ import annotations

import math

import numpy as np
import pytest
import uncertainties
from uncertainties import UFloat, umath, unumpy

from pipeline.numerics.estimate import Estimate
from springmass.result.values import Value


@pytest.fixture
def period() -> Value:
    """A period of 0.7431(2) s."""
    return Value.of(Estimate(0.7431, 0.0002, "s"))


@pytest.fixture
def stiffness() -> Value:
    """A spring constant of 14.00(10) N/m."""
    return Value.of(Estimate(14.0, 0.1, "N/m"))


@pytest.mark.parametrize(
    "function",
    [umath.log, np.log, umath.sqrt, np.sqrt, np.exp, np.cos, np.arctan, abs, lambda x: x**2, lambda x: 1 / x],
    ids=["umath.log", "log", "umath.sqrt", "sqrt", "exp", "cos", "arctan", "abs", "square", "inverse"],
)
def test_no_function_drops_the_uncertainty(period: Value, function) -> None:  # type: ignore[no-untyped-def]
    """Against the same function of a plain number with uncertainty."""
    known = {np.log: umath.log, np.sqrt: umath.sqrt, np.exp: umath.exp, np.cos: umath.cos, np.arctan: umath.atan}
    plain = uncertainties.ufloat(0.7431, 0.0002)
    expected = plain if function is abs else known.get(function, function)(plain)
    found = function(period)
    assert isinstance(found, UFloat)
    assert found.nominal_value == pytest.approx(expected.nominal_value, rel=1e-12)
    assert found.std_dev == pytest.approx(expected.std_dev, rel=1e-12)


def test_arrays_of_values(period: Value) -> None:
    """An array of values has uncertainties, means and functions."""
    several = np.array([period, 2.0 * period])
    assert unumpy.std_devs(several) == pytest.approx([0.0002, 0.0004])
    assert several.mean().std_dev == pytest.approx(0.0003)
    assert np.sqrt(several)[0].std_dev == pytest.approx(0.0001 / math.sqrt(0.7431))
    assert uncertainties.correlation_matrix(several)[0, 1] == pytest.approx(1.0)


@pytest.mark.parametrize(
    "lossy", [float, math.log, lambda x: np.array([x], dtype=float)], ids=["float", "math.log", "array"]
)
def test_what_would_drop_the_uncertainty_is_refused(period: Value, lossy) -> None:  # type: ignore[no-untyped-def]
    """A plain number is asked for by ``value``."""
    with pytest.raises(TypeError):
        lossy(period)


def test_units_stay_where_they_are_right(period: Value, stiffness: Value) -> None:
    """Products, quotients and powers have a unit of results or none; a sum has one only of equal units."""
    assert (2.0 * period).unit == "s"
    assert (1.0 / period).unit == "1/s"
    assert (stiffness * period**2).unit == "kg"
    assert np.sqrt(period * period).unit == "s"
    assert (period / period).unit == ""
    assert (period + period).unit == "s"
    assert (period + 1.0).unit is None
    assert (stiffness * period).unit is None
    assert umath.log(period).nominal_value == math.log(0.7431)
