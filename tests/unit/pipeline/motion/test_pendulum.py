"""A pendulum of a stated length: the period of very small swings and g, from whatever is recorded of it."""

import math

import numpy as np
import pytest

from pipeline.analyse import analyse
from pipeline.bench.scene import Scene
from pipeline.track import Track
from tests.trials.grades.kinds import Draw, swung

LENGTH = Scene.from_mapping({"pendulum": {"length_m": {"value": 1.0, "u": 1e-4}}})
SMALL_S = math.tau / math.sqrt(9.81)
T = np.arange(1800) / 30.0


@pytest.mark.parametrize("degrees", [10.0, 35.0, 60.0])
@pytest.mark.parametrize(("unit", "sigma"), [("m", 5e-4), ("rad", 2e-3), ("rad/s", 3e-3)])
def test_small_swings_and_gravity_are_covered_up_to_sixty_degrees(degrees: float, unit: str, sigma: float) -> None:
    """Of an angle, an angular velocity and a horizontal position; no line asks for a mass."""
    draw = Draw(unit, int(degrees))
    angle, speed = swung(T, degrees, 1.0, 0.004)
    y = {"m": np.sin(angle), "rad": angle, "rad/s": speed}[unit] + sigma * draw.rng.standard_normal(T.size)
    found = analyse(Track.from_arrays(T, y, unit=unit), LENGTH).estimates
    for name, truth in (("period_small_swings", SMALL_S), ("gravity", 9.81)):
        assert abs(found[name].value - truth) < 3.0 * found[name].u < 2e-3 * truth
    assert "spring_constant" not in found


def test_what_keeps_its_period_is_no_pendulum() -> None:
    """The law is not applied to an angle of 35 degrees whose period does not change: of a torsion balance."""
    rng = np.random.default_rng(5)
    y = 0.6 * np.exp(-0.004 * T) * np.cos(math.tau / 2.0 * T) + 2e-3 * rng.standard_normal(T.size)
    found = analyse(Track.from_arrays(T, y, unit="rad"), LENGTH).estimates
    assert abs(found["period"].value - 2.0) < 3.0 * found["period"].u
    assert abs(found.get("period_small_swings", found["period"]).value - 2.0) < 1e-3
