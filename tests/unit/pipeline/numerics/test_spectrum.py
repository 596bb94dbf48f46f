"""Lines are found at the rate stated, on white noise and on coloured, and their size is that of a sinusoid."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.numerics.spectrum import (
    Band,
    Blocks,
    smooth_density,
    strongest,
)

BAND = Band(0.3, 5.0, ((1.3, 0.2),))


def coloured(size: int, rho: float, seed: int) -> np.ndarray:
    """Return a first-order autoregression of unit variance, by its definition."""
    steps = np.random.default_rng(seed).standard_normal(size) * math.sqrt(1.0 - rho**2)
    y = np.empty(size)
    y[0] = steps[0] / math.sqrt(1.0 - rho**2)
    for k in range(1, size):
        y[k] = rho * y[k - 1] + steps[k]
    return y


def blocks(y: np.ndarray, rate_hz: float = 100.0) -> Blocks:
    """Return the block means of values at the rate, six samples a block."""
    return Blocks.of(np.arange(y.size) / rate_hz, y, 0.06, rate_hz)


def constant(of: Blocks) -> tuple[np.ndarray, np.ndarray]:
    """Return what a model with a constant alone leaves, and its basis."""
    basis = of.weight[:, None] / np.linalg.norm(of.weight)
    data = of.y * of.weight
    return data - basis @ (basis.T @ data), basis


def test_density_of_coloured_noise_follows_its_spectrum() -> None:
    """A first-order autoregression has the density of its formula, high at low frequencies."""
    y = coloured(20_000, 0.9, 2)
    for turns in (0.01, 0.1, 0.3):
        expected = (1.0 - 0.81) / abs(1.0 - 0.9 * np.exp(-2j * np.pi * turns)) ** 2
        assert smooth_density(y, turns) == pytest.approx(expected, rel=0.2)


@pytest.mark.parametrize("rho", [0.0, 0.9, 0.98])
def test_noise_shows_no_line(rho: float) -> None:
    """Of 200 records of noise hardly any has a line at 0.01."""
    found = 0
    for seed in range(200):
        of = blocks(coloured(1500, rho, seed) if rho else np.random.default_rng(seed).standard_normal(1500))
        peak = strongest(of, *constant(of), BAND)
        assert peak is not None
        found += peak.false_alarm < 0.01
    assert found <= 4


def test_line_is_found_at_its_frequency() -> None:
    """A sinusoid of half the noise stands out, within a quarter of a bin."""
    t = np.arange(3000) / 100.0
    y = np.random.default_rng(3).standard_normal(t.size) + 0.5 * np.cos(2 * np.pi * 0.803 * t + 1.0)
    of = blocks(y)
    peak = strongest(of, *constant(of), BAND)
    assert peak is not None
    assert peak.false_alarm < 1e-4
    assert peak.frequency_hz == pytest.approx(0.803, abs=0.25 / 30.0)
    # Half the fall of the sum of squares is N B^2 / 4.
    assert peak.evidence * peak.density * of.samples == pytest.approx(3000 * 0.25 / 4, rel=0.25)
