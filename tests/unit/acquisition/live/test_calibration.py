"""Calibration: a bob at rest, a ruler, and the speed of sound that can be applied again."""

import math
from typing import Any

import numpy as np
import pytest

from acquisition.errors import CalibrationError
from acquisition.live.calibration import Calibration, StillPoint, against_ruler, from_still


def still(rest_m: float, noise_m: float = 1e-4, seed: int = 1, n: int = 300) -> StillPoint:
    """Return what three seconds of a bob at rest give."""
    return from_still(rest_m + noise_m * np.random.default_rng(seed).standard_normal(n))


def test_a_still_bob_gives_rest_and_noise_with_an_honest_uncertainty() -> None:
    """Over 200 seeds the rest's error has the size that u states, and the noise is right."""
    points = [still(0.3, 2e-4, seed) for seed in range(200)]
    z = [(point.rest_m - 0.3) / point.u_rest_m for point in points]
    assert 0.8 < np.std(z) < 1.2
    assert np.median([point.noise_m for point in points]) == pytest.approx(2e-4, rel=0.1)
    assert {point.samples for point in points} == {300}


def test_outliers_and_missing_samples_do_not_move_the_rest() -> None:
    """A tenth of false echoes and a few missing samples leave the rest within its noise."""
    distance = 0.3 + 1e-4 * np.random.default_rng(2).standard_normal(300)
    distance[::10] += 0.02
    distance[5:15] = np.nan
    point = from_still(distance)
    assert point.rest_m == pytest.approx(0.3, abs=1e-4)
    assert point.samples == 290
    assert point.noise_m < 3e-4


@pytest.mark.parametrize("amplitude_m", [0.003, 0.05])
def test_a_moving_bob_is_refused(amplitude_m: float) -> None:
    """A swing of 3 mm is seen beside noise of 0.1 mm."""
    t = np.arange(300) / 100
    moving = 0.3 + amplitude_m * np.sin(7.9 * t) + 1e-4 * np.random.default_rng(3).standard_normal(300)
    with pytest.raises(CalibrationError, match=r"^[^\n]*the bob moves[^\n]*hangs still[^\n]*$"):
        from_still(moving)


def test_the_rulers_uncertainty_covers() -> None:
    """Over 300 seeds the error of scale and offset has the size that is stated."""
    known = (0.2, 0.5, 0.9)
    z = []
    for seed in range(300):
        read = np.array(known) + 5e-4 * np.random.default_rng(seed).standard_normal(3)
        result = against_ruler(tuple(StillPoint(y, 1e-6, 1e-5, 100) for y in known), tuple(read), 5e-4)
        z.append([(result.scale - 1) / result.u_scale, result.offset_m / result.u_offset_m])
    assert np.std(z, axis=0) == pytest.approx([1.0, 1.0], abs=0.15)


def test_a_ruler_goes_on_from_the_calibration_before() -> None:
    """Points measured with a base calibration give one that carries raw distances to the ruler's."""
    base = Calibration(343.0, 1.02, 0.004)
    raw = np.array([0.2, 0.6])
    known = 1.005 * (1.02 * raw + 0.004) + 0.003
    points = tuple(StillPoint(float(d), 1e-5, 1e-4, 300) for d in 1.02 * raw + 0.004)
    result = against_ruler(points, tuple(known), 1e-5, base)
    np.testing.assert_allclose([result.distance(math.nan, distance) for distance in raw], known, atol=1e-12)
    assert result.speed_of_sound_m_per_s == 343.0


def test_distances_close_together_give_no_scale() -> None:
    """Two marks 1 cm apart at half a metre tell an offset and nothing of the scale."""
    points = (StillPoint(0.50, 1e-4, 1e-3, 300), StillPoint(0.51, 1e-4, 1e-3, 300))
    result = against_ruler(points, (0.503, 0.513), 5e-4)
    assert (result.scale, result.u_scale) == (1.0, 0.0)
    assert result.offset_m == pytest.approx(0.003)


def test_a_wrong_unit_is_refused() -> None:
    """A ruler read in inches asks for a scale that no sensor has."""
    points = (StillPoint(0.2, 1e-4, 1e-3, 300), StillPoint(0.6, 1e-4, 1e-3, 300))
    with pytest.raises(CalibrationError, match=r"^[^\n]*check the unit[^\n]*$"):
        against_ruler(points, (0.2 / 0.0254, 0.6 / 0.0254), 1e-3)


@pytest.mark.parametrize(
    "numbers",
    [
        {"speed_of_sound_m_per_s": 34.4},
        {"speed_of_sound_m_per_s": float("nan")},
        {"scale": 0.0},
        {"scale": float("nan")},
        {"offset_m": float("inf")},
        {"colour": 1.0},
        {"scale": "wide"},
        {"scale": None},
    ],
)
def test_numbers_that_calibrate_nothing_are_refused_in_one_line(numbers: dict[str, Any]) -> None:
    """Values out of range, of no number and unknown names are a CalibrationError."""
    with pytest.raises(CalibrationError, match=r"^[^\n]+$"):
        Calibration.from_mapping(numbers)
