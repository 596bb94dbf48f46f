"""The part of a spring that oscillates with its load."""

import math

import pytest

from pipeline.bench.spring import oscillating_mass_kg, unstated_spring_kg


@pytest.mark.parametrize("ratio", [1e-9, 1e-4, 1e-3, 0.1, 0.5, 1.0, 10.0, 1e6])
def test_mass_fulfils_the_wave_equations_condition(ratio: float) -> None:
    """x^2 = m_s/M of the mass M returned fulfils x tan x = m_s/m."""
    x = math.sqrt(ratio / oscillating_mass_kg(ratio, 1.0))
    assert math.atan2(ratio, x) == pytest.approx(x, rel=1e-12)


def test_an_unweighed_spring_is_uncertain_by_a_share_of_the_bob() -> None:
    """0 to 0.3 of the bob, uncorrected: its root mean square."""
    assert unstated_spring_kg(0.2).u == pytest.approx(0.06 / math.sqrt(3.0))
