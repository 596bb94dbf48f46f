"""Jumps of a series are found by a test of stated probability, and a smooth course shows none."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.track import F8
from pipeline.windows.change_points import Params, find_changes, lone_points

FALSE_ALARM = 0.05
TRIALS = 100
# Of 100 trials at a true 5 % more than 12 show a jump once in a thousand.
MOST = 12


def indices(y: F8, u: float = 1.0, t: F8 | None = None) -> list[int]:
    """Return the first points after the jumps of one component."""
    times = np.arange(y.size, dtype=np.float64) if t is None else t
    return [change.index for change in find_changes(times, y[None], np.full((1, y.size), u))]


@pytest.mark.parametrize("components", [1, 2])
@pytest.mark.parametrize("size", [12, 40, 160])
@pytest.mark.parametrize(("rho", "stated"), [(0.0, 1.0), (0.3, 1.0), (0.6, 1.0), (0.0, 0.3)])
def test_noise_shows_a_jump_no_oftener_than_stated(components: int, size: int, rho: float, stated: float) -> None:
    """White noise, noise that remembers, and noise three times the stated one keep Bonferroni's bound."""
    rng = np.random.default_rng([components, size, round(10 * rho), round(10 * stated)])
    t, u = np.arange(size, dtype=np.float64), np.full((components, size), stated)
    alarms = 0
    for _ in range(TRIALS):
        y = rng.standard_normal((components, size))
        for k in range(1, size if rho else 0):
            y[:, k] = rho * y[:, k - 1] + math.sqrt(1.0 - rho**2) * y[:, k]
        alarms += bool(find_changes(t, y, u, Params(false_alarm=FALSE_ALARM)))
    assert alarms <= MOST


@pytest.mark.parametrize("amplitude", [10.0, 100.0])
@pytest.mark.parametrize("period", [5, 12, 20, 40, 84, 200])
def test_a_wave_is_no_jump(amplitude: float, period: int) -> None:
    """A course that goes to and fro, however slowly and far beyond its noise, does not jump."""
    rng = np.random.default_rng(period)
    for phase in range(6):
        wave = amplitude * np.sin(2.0 * math.pi * np.arange(160) / period + phase)
        assert indices(wave + rng.standard_normal(160)) == []


@pytest.mark.parametrize("size", [33, 160])
def test_a_jump_of_eight_standard_deviations_is_placed(size: int) -> None:
    """Anywhere in the middle third it is found to a point, and nothing else beside it, upon a drift too."""
    rng = np.random.default_rng(size)
    t = np.arange(size, dtype=np.float64)
    found = 0
    for _ in range(40):
        at = int(rng.integers(size // 3, 2 * size // 3))
        places = indices(8.0 * (t >= at) + 3e-4 * t**2 + rng.standard_normal(size))
        found += len(places) == 1 and abs(places[0] - at) <= 1
    assert found >= 38


def test_times_with_a_gap_are_no_jump() -> None:
    """Of a falling course thirty points are missing: it goes on where it must be by then."""
    t = np.concatenate([np.arange(60.0), np.arange(90.0, 160.0)])
    assert indices(100.0 - t + np.random.default_rng(3).standard_normal(t.size), t=t) == []


def test_a_point_between_two_jumps_holds_one() -> None:
    """A window in which the motion changes lies between both sides, and the change is counted once."""
    y = np.where(np.arange(80) < 40, 0.0, 60.0) + np.random.default_rng(4).standard_normal(80)
    y[40] = 30.0
    (place,) = indices(y)
    assert place in (40, 41)


def test_lone_points_are_told_from_jumps() -> None:
    """Single points and pairs far off are alone; the points on either side of a jump are not."""
    y = np.random.default_rng(5).standard_normal((1, 60)) + 40.0 * (np.arange(60) >= 40)
    y[0, 10] += 30.0
    y[0, 20:22] -= 30.0
    assert np.flatnonzero(lone_points(y, np.ones((1, 60)), 1e-3)).tolist() == [10, 20, 21]


def test_places_agree_with_an_exact_partition() -> None:
    """The places are those of the optimal partition into constants, for as many jumps.

    ruptures solves that by dynamic programming; it is a test's oracle alone, because its import takes a second and it
    knows neither uncertainties of points nor a probability of a false alarm.
    """
    import ruptures

    for seed in range(2):
        rng = np.random.default_rng(seed)
        places = np.sort(rng.choice([40, 80, 120, 160], 3, replace=False)) + rng.integers(-8, 8, 3)
        y = rng.standard_normal(200) + np.sum(
            [(-1) ** k * 9.0 * (np.arange(200) >= at) for k, at in enumerate(places)], axis=0
        )
        best = ruptures.Dynp(model="l2", jump=1).fit(y).predict(n_bkps=3)[:-1]
        np.testing.assert_allclose(indices(y), best, atol=1)
