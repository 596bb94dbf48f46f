"""Residuals are what the windows leave of the samples used, on the grid of the recording."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.analyse import Oscillation, analyse
from pipeline.checks.residuals import Residuals, residuals_of
from pipeline.track import F8, Track

T: F8 = np.arange(2000) / 100.0


def residuals(y: F8) -> Residuals | None:
    """Return the residuals of the analysis of distances."""
    result = analyse(Track.from_arrays(np.arange(y.size) / 100.0, y))
    assert isinstance(result.motion, Oscillation)
    motion = result.motion
    return residuals_of(result.conditioned, motion.demodulated, motion.disturbances, motion.phase)


def test_residuals_are_the_noise() -> None:
    """Of a bob in white noise they have its size, its amplitude and the phase that turns with the bob."""
    noise = 3e-4 * np.random.default_rng(1).standard_normal(T.size)
    found = residuals(0.3 + 0.05 * np.cos(8.3 * T + 0.4) + noise)
    assert found is not None
    assert found.noise_m == pytest.approx(3e-4, rel=0.1)
    assert np.std(found.values) == pytest.approx(3e-4, rel=0.1)
    assert found.amplitude_m == pytest.approx(0.05, rel=1e-2)
    assert (found.interval_s, found.radians_per_sample) == (pytest.approx(0.01), pytest.approx(0.083, rel=1e-3))
    np.testing.assert_allclose(np.cos(found.phase), np.cos(8.3 * T[found.used] + 0.4), atol=0.02)
    assert np.corrcoef(found.values, noise[found.used])[0, 1] > 0.95


def test_samples_left_out_are_gaps_on_the_grid() -> None:
    """Missing samples have no residual, are 0 on the grid of all samples, and shift no other sample."""
    y = 0.3 + 0.05 * np.cos(8.3 * T) + 3e-4 * np.random.default_rng(2).standard_normal(T.size)
    y[500:520] = np.nan
    found = residuals(y)
    assert found is not None
    assert not found.used[500:520].any()
    assert not found.on_grid[~found.used].any()
    np.testing.assert_array_equal(found.on_grid[found.used], found.values)
    np.testing.assert_array_equal(found.less(found.values).values, 0.0)
    assert found.interval_s == pytest.approx(0.01)


def test_too_few_samples_have_no_residuals_to_look_at() -> None:
    """Below 64 samples nothing is looked for."""
    t = np.arange(60) / 10.0
    result = analyse(
        Track.from_arrays(t, 0.3 + 0.05 * np.cos(8.3 * t) + 1e-4 * np.random.default_rng(3).standard_normal(60))
    )
    assert isinstance(result.motion, Oscillation)
    motion = result.motion
    assert residuals_of(result.conditioned, motion.demodulated, motion.disturbances, motion.phase) is None
