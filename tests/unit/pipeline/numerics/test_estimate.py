"""Numbers are printed to the digits that their uncertainties allow."""

import re

from hypothesis import assume, example, given
from hypothesis import strategies as st

from pipeline.numerics.estimate import Estimate

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


SIGNED = st.builds(lambda m, p, s: s * m * 10.0**p, st.floats(1, 9.999), st.integers(-30, 30), st.sampled_from([-1, 1]))


@given(SIGNED | st.just(0.0), st.floats(1, 9.9999), st.integers(-12, 3), st.sampled_from(["", "s", "N/m"]))
@example(value=0.0999, mantissa=9.96, power=-2, unit="")
@example(value=999999.9, mantissa=1.0, power=0, unit="")
@example(value=9.9999e-5, mantissa=1.0, power=-4, unit="")
def test_printed_value_is_the_value_within_a_tenth_of_u(value: float, mantissa: float, power: int, unit: str) -> None:
    """Read back, the value errs by less than u / 10 and u by less than a twentieth of itself."""
    u = mantissa * 10.0**power * (abs(value) if value else 1.0)
    assume(1e-280 < u < 1e280)
    back, u_back, digits, u_digits = parse(str(Estimate(value, u, unit)))
    assert abs(back - value) <= 0.1 * u
    assert abs(u_back - u) <= 0.0501 * u
    assert len(digits.partition(".")[2]) == len(u_digits.partition(".")[2])
