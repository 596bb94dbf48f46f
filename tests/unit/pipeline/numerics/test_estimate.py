"""Numbers are printed to the digits that their uncertainties allow, and travel together with their covariance."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from pipeline.numerics.estimate import Estimate, Joint, format_value

PLAIN = re.compile(r"^(-?[\d.]+) \+- ([\d.]+)( \S+)?$")
SCALED = re.compile(r"^\((-?[\d.]+) \+- ([\d.]+)\)e([+-]\d+)( \S+)?$")


def parse(text: str) -> tuple[float, float, str, str]:
    """Return value, u and both as printed (mantissas)."""
    if found := PLAIN.match(text):
        return float(found[1]), float(found[2]), found[1], found[2]
    found = SCALED.match(text)
    assert found is not None, text
    value, u = float(f"{found[1]}e{found[3]}"), float(f"{found[2]}e{found[3]}")
    return value, u, found[1], found[2]


@pytest.mark.parametrize(
    ("value", "u", "unit", "text"),
    [
        (0.752857, 0.001429, "s", "0.7529 +- 0.0014 s"),
        (13.979, 0.0531, "N/m", "13.979 +- 0.053 N/m"),
        (16.311, 0.0643, "N/m", "16.311 +- 0.064 N/m"),
        (1216.17, 5.96, "", "1216.2 +- 6.0"),
        (1216.17, 24.3, "", "1216 +- 24"),
        (101325.0, 1500.0, "Pa", "101300 +- 1500 Pa"),
        (0.0, 0.5, "m", "0.00 +- 0.50 m"),
        (-2.5, 0.5, "rad", "-2.50 +- 0.50 rad"),
        (0.0999, 0.0999, "", "0.10 +- 0.10"),
        (9.996, 0.0996, "s", "10.00 +- 0.10 s"),
        (1.5e-7, 2.0e-9, "m", "(1.500 +- 0.020)e-07 m"),
        (-1.5e-7, 2.0e-9, "m", "(-1.500 +- 0.020)e-07 m"),
        (2.5e9, 1.2e7, "Hz", "(2.500 +- 0.012)e+09 Hz"),
        (13.98, 0.0, "N/m", "13.98 N/m"),
        (13.98, 0.0, "", "13.98"),
    ],
)
def test_printed_form(value: float, u: float, unit: str, text: str) -> None:
    """Two digits of u, the value to the same place, the unit behind; powers of ten where plain digits get long."""
    assert format_value(value, u, unit) == text
    assert str(Estimate(value, u, unit)) == text


@pytest.mark.parametrize(("value", "u"), [(math.nan, 1.0), (1.0, math.inf), (math.inf, math.nan), (math.nan, 0.0)])
def test_not_finite_is_printed_as_such(value: float, u: float) -> None:
    """What is not finite is shown, not raised."""
    assert format_value(value, u, "s") == f"{value:g} +- {u:g} s"


SIGNED = st.builds(lambda m, p, s: s * m * 10.0**p, st.floats(1, 9.999), st.integers(-30, 30), st.sampled_from([-1, 1]))


@settings(max_examples=500)
@given(SIGNED | st.just(0.0), st.floats(1, 9.9999), st.integers(-12, 3), st.sampled_from(["", "s", "N/m"]))
@example(value=0.0999, mantissa=9.96, power=-2, unit="")
@example(value=999999.9, mantissa=1.0, power=0, unit="")
@example(value=9.9999e-5, mantissa=1.0, power=-4, unit="")
def test_printed_value_is_the_value_within_a_tenth_of_u(value: float, mantissa: float, power: int, unit: str) -> None:
    """Read back, the value errs by less than u / 10 and u by less than a twentieth of itself."""
    u = mantissa * 10.0**power * (abs(value) if value else 1.0)
    assume(1e-280 < u < 1e280)
    back, u_back, digits, u_digits = parse(format_value(value, u, unit))
    assert abs(back - value) <= 0.1 * u
    assert abs(u_back - u) <= 0.0501 * u
    assert len(digits.partition(".")[2]) == len(u_digits.partition(".")[2])


@settings(max_examples=300)
@given(st.floats(-9.9e5, 9.9e5), st.floats(1e-4, 9.9e5))
def test_u_has_two_digits(value: float, u: float) -> None:
    """u is printed with two significant digits, no more and no fewer."""
    assume(max(abs(value), u) >= 1e-4)
    printed = parse(format_value(value, u))[1]
    assert printed == pytest.approx(float(f"{u:.1e}"), rel=1e-9)


@given(st.floats(), st.floats())
def test_any_pair_is_printed(value: float, u: float) -> None:
    """No number, however odd, stops a report."""
    assert format_value(value, u, "m").endswith(" m")


JOINT = Joint(("A0", "gamma"), np.array([0.05, 0.01]), np.array([[4e-10, -1e-10], [-1e-10, 1e-8]]), ("m", "1/s"))


def test_marginal_uncertainty() -> None:
    """A parameter comes out with the root of its variance and its unit."""
    assert JOINT["A0"] == Estimate(0.05, pytest.approx(2e-5), "m")
    assert JOINT["gamma"] == Estimate(0.01, pytest.approx(1e-4), "1/s")
    assert list(JOINT.estimates()) == ["A0", "gamma"]


def test_unknown_parameter_is_an_error() -> None:
    """A name that was not estimated raises."""
    with pytest.raises(ValueError):
        JOINT["beta"]


def test_rounding_below_zero_variance_is_no_uncertainty() -> None:
    """A variance that rounding made negative counts as 0."""
    assert Joint(("x",), np.array([1.0]), np.array([[-1e-30]]), ("",))["x"].u == 0.0
