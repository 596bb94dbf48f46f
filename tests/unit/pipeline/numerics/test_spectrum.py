"""Lines are found at the rate stated, on white noise and on coloured, and their size is that of a sinusoid."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.numerics.spectrum import (
    Band,
    Blocks,
    false_alarm,
    smooth_density,
    spectral_density,
    strongest,
    worth_a_look,
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


def test_blocks_are_means_at_mean_times() -> None:
    """Values and times are averaged over the samples there; a block without any is empty."""
    t = np.array([0.0, 0.01, 0.02, 0.03, 0.10, 0.11])
    found = Blocks.of(t, np.array([1.0, 2.0, 3.0, 4.0, 5.0, 7.0]), 0.04, 100.0)
    np.testing.assert_allclose(found.y, [2.5, 0.0, 6.0])
    np.testing.assert_allclose(found.weight, [2.0, 0.0, math.sqrt(2.0)])
    np.testing.assert_allclose(found.t[[0, 2]] + found.origin, [0.015, 0.105])
    assert (found.samples, found.step) == (4.0, pytest.approx(0.04))


@pytest.mark.parametrize("frequency_hz", [0.5, 2.0, 4.0])
def test_attenuation_is_what_averaging_does(frequency_hz: float) -> None:
    """The mean of a cosine over a block is the cosine at its middle times the factor stated."""
    t = np.arange(600) / 100.0
    found = Blocks.of(t, np.cos(2 * np.pi * frequency_hz * t), 0.06, 100.0)
    middle = np.cos(2 * np.pi * frequency_hz * (found.t + found.origin))
    np.testing.assert_allclose(found.y, found.attenuation(frequency_hz) * middle, atol=1e-12)


def test_density_of_white_noise_is_its_variance() -> None:
    """Autoregression and neighbours give the variance of one block at every frequency."""
    of = blocks(np.random.default_rng(1).standard_normal(60_000))
    for f in (0.5, 2.0, 4.0):
        # The larger of two estimates, one of them from ten neighbours, so not below and up to twice.
        assert 0.9 / 6.0 < spectral_density(of, of.y, f, BAND, smooth_density(of.y, f * of.step)) < 2.0 / 6.0
        assert smooth_density(of.y, f * of.step) == pytest.approx(1.0 / 6.0, rel=0.1)


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


def test_line_within_a_hole_is_not_sought() -> None:
    """What the model holds already is no candidate, however strong."""
    t = np.arange(3000) / 100.0
    of = blocks(np.random.default_rng(3).standard_normal(t.size) + 3.0 * np.cos(2 * np.pi * 1.3 * t))
    peak = strongest(of, *constant(of), BAND)
    assert peak is not None
    assert peak.false_alarm > 0.01
    assert not worth_a_look(of, BAND, (3.7,), 0.005)
    assert worth_a_look(of, Band(0.3, 5.0, ()), (2.6,), 0.005)
    assert worth_a_look(of, BAND, (1.3,), 0.005)


def test_empty_band_has_no_line() -> None:
    """Where nothing is left between the holes there is no peak."""
    of = blocks(np.random.default_rng(3).standard_normal(600))
    assert strongest(of, *constant(of), Band(1.2, 1.4, ((1.3, 0.2),))) is None
    assert not worth_a_look(of, Band(1.2, 1.4, ((1.3, 0.2),)), (2.6,), 0.005)


def test_probability_falls_with_evidence_and_rises_with_trials() -> None:
    """No evidence is certain to be reached; more of it, less likely; more places to look, more likely."""
    assert false_alarm(0.0, 1.0) == 1.0
    falling = [false_alarm(z, 100.0) for z in (1.0, 10.0, 30.0, 100.0)]
    assert falling == sorted(falling, reverse=True)
    assert false_alarm(30.0, 1000.0) > false_alarm(30.0, 10.0)
