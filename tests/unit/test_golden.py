"""The report's numbers, recomputed from its own inputs; a golden value is never changed to make a test pass."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.classic import classic
from pipeline.compare import SpringRun, compare_springs
from pipeline.estimate import Estimate, format_value
from pipeline.scene import Scene
from pipeline.track import Track

BARE = Scene.from_mapping({"bob": {"mass_kg": {"value": 0.2007, "u": 0.00005}}})
DISC = Scene.from_mapping(
    {
        "bob": {"mass_kg": {"value": 0.2176, "u": 0.00005}},
        "disc": {"diameter_m": {"value": 0.102, "u": 0.0005}},
    }
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


def test_reports_spring_constants_are_28_sigma_apart() -> None:
    """13.979 +- 0.053 against 16.31 +- 0.064 N/m is 28 standard uncertainties for one spring."""
    bare, disc = estimates(5.27, BARE)["spring_constant"], estimates(5.08, DISC)["spring_constant"]
    assert (disc.value - bare.value) / math.hypot(bare.u, disc.u) == pytest.approx(28.0, abs=0.5)


def test_exchanged_periods_agree() -> None:
    """With the periods exchanged the two runs give 15.05 and 15.15 N/m and agree."""
    bare, disc = estimates(5.08, BARE)["spring_constant"], estimates(5.27, DISC)["spring_constant"]
    assert bare.value == pytest.approx(15.05, abs=0.01)
    assert disc.value == pytest.approx(15.15, abs=0.01)
    assert abs(bare.value - disc.value) < 1.5 * math.hypot(bare.u, disc.u)
    runs = [
        SpringRun(name, estimates(seconds, scene)["angular_frequency"], scene.bob_mass_kg)
        for name, seconds, scene in (("undamped", 5.27, BARE), ("damped", 5.08, DISC))
        if scene.bob_mass_kg is not None
    ]
    assert compare_springs(runs).exchanged == ("undamped", "damped")


def test_amplitude_is_six_centimetres() -> None:
    """(0.32482 - 0.20653)/2 m = 0.05914 m, where the report took centimetres for metres twice; u is 1.69 mm."""
    t = np.arange(1000) / 100
    y = 0.265675 + 0.059145 * np.cos(2 * math.pi * (t - 0.5) / 0.7525)
    y[50], y[100] = 0.32482, 0.20653
    found = classic(Track.from_arrays(t, np.clip(y, 0.20653, 0.32482))).estimates["amplitude"]
    assert found.value == pytest.approx(0.05914, abs=1e-5)
    assert found.u == pytest.approx(0.00169, abs=5e-6)


def test_reynolds_number_from_the_length_alone() -> None:
    """1.204 x 0.18073 x 0.102 / 1.825e-5 = 1216 +- 6 where only the disc's diameter is uncertain."""
    velocity = 0.18073 * np.where(np.arange(1000) % 2, 1.0, -1.0)
    found = classic(replace(seven_cycles(5.08), velocity=velocity), DISC).estimates
    assert found["velocity_rms"].value == pytest.approx(0.18073, abs=1e-12)
    assert found["reynolds_number"].value == pytest.approx(1216.2, abs=0.1)
    assert found["reynolds_number"].u == pytest.approx(5.96, abs=0.01)
    assert str(found["reynolds_number"]) == "1216.2 +- 6.0"


def test_velocity_uncertainty_as_printed_and_as_right() -> None:
    """Eq. 25 divides the spread of v^2 by N: 7e-6 m/s as printed; with the root of N it is near 1e-3 m/s."""
    n = 12_020
    velocity = np.where(np.arange(n) % 2, math.sqrt(2) * 0.18073, 0.0)
    found = classic(replace(seven_cycles(5.08), velocity=velocity), DISC).estimates["velocity_rms"]
    spread = float((velocity**2).std())
    assert spread == pytest.approx(0.03266, abs=1e-5)
    assert found.u == pytest.approx(7.5e-6, abs=1e-7)
    assert found.u * math.sqrt(n) == pytest.approx(8.2e-4, abs=1e-5)


@pytest.mark.parametrize(
    ("value", "u", "unit", "text"),
    [
        (5.27 / 7, 0.01 / 7, "s", "0.7529 +- 0.0014 s"),
        (13.9793, 0.0532, "N/m", "13.979 +- 0.053 N/m"),
        (16.3113, 0.0643, "N/m", "16.311 +- 0.064 N/m"),
        (8.34580, 0.01584, "1/s", "8.346 +- 0.016 1/s"),
    ],
)
def test_golden_values_as_printed(value: float, u: float, unit: str, text: str) -> None:
    """Two digits of uncertainty, where the report printed one and rounded it down."""
    assert format_value(value, u, unit) == text
