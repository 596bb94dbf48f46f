"""The report's numbers, recomputed from its own inputs; a golden value is never changed to make a test pass.

One test or more for each mistake on docs/tutorial-report.md, in the report's order.
"""

import math

import numpy as np
import pytest

from pipeline.bench.scene import Scene
from pipeline.numerics.estimate import Estimate
from pipeline.results.classic import classic
from pipeline.several.compare import SpringRun, compare_springs
from pipeline.track import Track

BARE = Scene.from_mapping({"bob": {"mass_kg": {"value": 0.2007, "u": 0.00005}}})
DISC = Scene.from_mapping(
    {"bob": {"mass_kg": {"value": 0.2176, "u": 0.00005}}, "disc": {"diameter_m": {"value": 0.102, "u": 0.0005}}}
)


def seven_cycles(seconds: float) -> Track:
    """Return a record in which a sampled maximum and the seventh after it lie so far apart."""
    t = np.arange(1000) / 100
    return Track.from_arrays(t, 0.265 + 0.05914 * np.cos(2 * math.pi * 7 * (t - 0.5) / seconds))


def estimates(seconds: float, scene: Scene) -> dict[str, Estimate]:
    """Return what the report's method makes of seven cycles of a length."""
    return classic(seven_cycles(seconds), scene).estimates


@pytest.mark.parametrize(
    ("seconds", "scene", "name", "value", "u", "digits_value", "digits_u"),
    [
        (5.27, BARE, "period", 0.75286, 0.00143, 5e-6, 5e-6),
        (5.27, BARE, "frequency", 1.32827, 0.0025, 5e-6, 5e-5),
        (5.27, BARE, "angular_frequency", 8.3458, 0.0158, 5e-5, 5e-5),
        (5.27, BARE, "spring_constant", 13.979, 0.053, 5e-4, 5e-4),
        (5.08, DISC, "period", 0.72571, 0.00143, 5e-6, 5e-6),
        (5.08, DISC, "frequency", 1.37795, 0.0027, 5e-6, 5e-5),
        (5.08, DISC, "angular_frequency", 8.658, 0.017, 5e-4, 5e-4),
        (5.08, DISC, "spring_constant", 16.311, 0.064, 5e-4, 5e-4),
    ],
)
def test_report_inputs_give_the_golden_values(
    seconds: float, scene: Scene, name: str, value: float, u: float, digits_value: float, digits_u: float
) -> None:
    """5.27 s and 5.08 s over seven cycles give the periods, frequencies and spring constants to the printed digit."""
    found = estimates(seconds, scene)[name]
    assert found.value == pytest.approx(value, abs=digits_value)
    assert found.u == pytest.approx(u, abs=digits_u)
    assert found.u > 0


def test_exchanged_periods_agree() -> None:
    """With the periods exchanged the two runs give 15.05 and 15.15 N/m to a digit in the last place, and agree."""
    bare, disc = estimates(5.08, BARE)["spring_constant"], estimates(5.27, DISC)["spring_constant"]
    assert bare.value == pytest.approx(15.05, abs=0.01)
    assert disc.value == pytest.approx(15.15, abs=0.01)
    assert (bare.value, disc.value) == pytest.approx((15.0444, 15.1563), abs=1e-4)
    assert abs(bare.value - disc.value) < 1.5 * math.hypot(bare.u, disc.u)
    runs = [
        SpringRun(name, estimates(seconds, scene)["angular_frequency"], scene.bob_mass_kg)
        for name, seconds, scene in (("undamped", 5.27, BARE), ("damped", 5.08, DISC))
        if scene.bob_mass_kg is not None
    ]
    assert compare_springs(runs).exchanged == ("undamped", "damped")


def test_amplitude_is_six_centimetres() -> None:
    """(17), (22b): (0.32482 - 0.20653)/2 m = 0.05914 m, centimetres taken for metres twice; u is 1.69 mm."""
    t = np.arange(1000) / 100
    y = 0.265675 + 0.059145 * np.cos(2 * math.pi * (t - 0.5) / 0.7525)
    y[50], y[100] = 0.32482, 0.20653
    found = classic(Track.from_arrays(t, np.clip(y, 0.20653, 0.32482))).estimates["amplitude"]
    # 0.059145 lies on the edge between two prints; the report cut the last digit off.
    assert math.floor(found.value * 1e5 + 1e-6) / 1e5 == pytest.approx(0.05914, abs=1e-12)
    assert found.u == pytest.approx(0.00169, abs=5e-6)
    assert found.u > 1e4 * 5e-8
