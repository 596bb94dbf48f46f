"""The rest position is a constant with an interval that holds, unless the record shows that it moves."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pipeline.motion.waveform import fit_rest
from pipeline.windows.demodulate import Demodulated

Windows = Callable[..., Demodulated]
T = 0.4 + 0.757 * np.arange(100)


def points(windows: Windows, offset: np.ndarray, u_m: float = 2e-5, t: np.ndarray = T) -> Demodulated:
    """Return windows with these rest positions."""
    return windows(t, 0.05, offset=offset, u=(1e-5, 1e-4, u_m))


def test_constant_is_the_mean_with_its_error(windows: Windows) -> None:
    """Over 200 runs the intervals of a constant rest hold it, and no drift is seen but in a few."""
    pulls, drifts = [], 0
    for seed in range(200):
        offset = 0.2 + np.random.default_rng(seed).normal(0.0, 2e-5, T.size)
        found = fit_rest(points(windows, offset))
        pulls.append((found.mean.value - 0.2) / found.mean.u)
        drifts += found.drifts
    assert np.mean(np.abs(pulls) <= 1.0) == pytest.approx(0.683, abs=0.1)
    assert np.mean(np.abs(pulls) <= 1.96) == pytest.approx(0.95, abs=0.045)
    assert drifts <= 2


def test_equal_weights_give_the_plain_mean(windows: Windows) -> None:
    """Where uncertainties are equal the value is the mean and u falls with the root of their number."""
    offset = 0.2 + np.random.default_rng(1).normal(0.0, 2e-5, T.size)
    found = fit_rest(points(windows, offset))
    assert found.mean.value == pytest.approx(offset.mean(), abs=1e-12)
    assert found.mean.u >= 2e-5 / np.sqrt(T.size) * 0.999
    assert found.mean.unit == "m"


@pytest.mark.parametrize("drift_m", [2e-4, -1e-3, 0.02])
def test_drift_is_found_and_followed(windows: Windows, drift_m: float) -> None:
    """A slow bend of the rest position is measured peak to peak and followed at any time."""
    truth = 0.2 + drift_m * (T / T[-1]) ** 2
    found = fit_rest(points(windows, truth + np.random.default_rng(2).normal(0.0, 2e-5, T.size)))
    assert found.drifts
    assert found.drift_m == pytest.approx(abs(drift_m), rel=0.1, abs=4e-5)
    np.testing.assert_allclose(found.curve, truth, atol=4e-5)
    np.testing.assert_allclose(found.at(T), found.curve, rtol=1e-12)
    assert found.mean.u > 2e-5 / np.sqrt(T.size)


def test_constant_is_constant_at_every_time(windows: Windows) -> None:
    """Without drift the rest position is the mean before, in and after the record."""
    offset = 0.2 + np.random.default_rng(3).normal(0.0, 2e-5, T.size)
    found = fit_rest(points(windows, offset))
    np.testing.assert_array_equal(found.at(np.array([-5.0, 3.3, 1e4])), np.full(3, found.mean.value))


@pytest.mark.parametrize("count", [1, 2, 3, 7])
def test_few_windows_do_not_drift(windows: Windows, count: int) -> None:
    """Under eight windows no drift is found."""
    offset = 0.2 + 0.01 * np.arange(count)
    found = fit_rest(points(windows, offset, t=T[:count]))
    assert not found.drifts
    assert found.drift_m == 0.0
    assert found.mean.value == pytest.approx(offset.mean(), abs=1e-12)


def test_one_jump_of_a_window_is_no_drift(windows: Windows) -> None:
    """A single window far off is left out."""
    offset = 0.2 + np.random.default_rng(4).normal(0.0, 2e-5, T.size)
    offset[50] += 0.01
    found = fit_rest(points(windows, offset))
    assert not found.drifts
    assert found.mean.value == pytest.approx(0.2, abs=1e-5)


def test_step_widens_the_mean(windows: Windows) -> None:
    """A step of the rest position makes its mean as uncertain as a share of the step."""
    offset = 0.2 + 1e-3 * (T > 40.0) + np.random.default_rng(5).normal(0.0, 2e-5, T.size)
    found = fit_rest(points(windows, offset))
    assert found.drifts
    assert found.mean.u > 1e-4


def test_a_beat_does_not_make_the_mean_uncertain(windows: Windows) -> None:
    """Rest positions that a beat takes to and fro count singly: their mean holds, its u is at most twice its error."""
    errors, stated = [], []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        beat = 1.5e-4 * np.cos(2.0 * np.pi * T / rng.uniform(8.0, 16.0) + rng.uniform(0.0, 6.3))
        found = fit_rest(points(windows, 0.2 + beat + rng.normal(0.0, 4e-5, T.size), 4e-5))
        errors.append(found.mean.value - 0.2)
        stated.append(found.mean.u)
    rms = np.sqrt(np.mean(np.square(errors)))
    assert rms < np.median(stated) < 3.0 * rms


def test_slow_wandering_makes_the_mean_uncertain(windows: Windows) -> None:
    """Of rest positions that remember the one before the intervals are wide: they do not pass for a beat."""
    inside = []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        walk = rng.normal(0.0, 1e-4, T.size)
        for k in range(1, T.size):
            walk[k] = 0.8 * walk[k - 1] + 0.6 * walk[k]
        found = fit_rest(points(windows, 0.2 + walk))
        inside.append(abs(found.mean.value - 0.2) < 2.0 * found.mean.u)
    assert np.mean(inside) > 0.85
