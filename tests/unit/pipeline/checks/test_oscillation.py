"""What has a line in its spectrum, but does not oscillate, is refused."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.analyse import Oscillation, Still, analyse
from pipeline.checks.oscillation import check_coherence, check_sinusoid, typical_miss
from pipeline.motion.fitted import Fitted
from pipeline.samples.condition import Conditioned, condition
from pipeline.track import F8, Track
from pipeline.windows.cycles import Cycles, NoOscillation, find_cycles
from pipeline.windows.demodulate import Demodulated, demodulate

T: F8 = np.arange(2000) / 100.0


def track(x: F8, sigma_m: float = 3e-4) -> Track:
    """Return a track of displacements with white noise."""
    return Track.from_arrays(T, 0.3 + x + sigma_m * np.random.default_rng(3).standard_normal(T.size))


def in_windows(x: F8) -> tuple[Conditioned, Demodulated]:
    """Return the samples and the windows of displacements."""
    samples = condition(track(x))
    cycles = find_cycles(samples)
    assert isinstance(cycles, Cycles)
    return samples, demodulate(samples, cycles)


def fitted(x: F8) -> tuple[Fitted, Track]:
    """Return the oscillation fitted to displacements."""
    result = analyse(track(x))
    assert isinstance(result.motion, Oscillation)
    return result.motion, result.track


@pytest.mark.parametrize("amplitude", [0.05, 5e-4])
def test_a_sinusoid_passes(amplitude: float) -> None:
    """A bob in white noise is an oscillation, and misses itself by less than its noise."""
    x = amplitude * np.exp(-0.01 * T) * np.cos(8.3 * T)
    assert check_sinusoid(*in_windows(x)) is None
    motion, recorded = fitted(x)
    missed = typical_miss(motion)
    assert missed < 3e-4 / amplitude
    assert check_coherence(motion, recorded, missed) is None


def test_periods_that_do_not_follow_one_another_are_refused() -> None:
    """Where half of the motion misses one oscillation by its amplitude, it is none."""
    motion, recorded = fitted(0.05 * np.cos(8.3 * T))
    assert isinstance(check_coherence(motion, recorded, 1.0), NoOscillation)


def test_a_line_with_wandering_phase_is_no_oscillation() -> None:
    """Noise that a narrow filter lets through has a line, and no phase that lasts."""
    white = np.random.default_rng(4).standard_normal(T.size)
    frequency = np.fft.rfftfreq(T.size, 0.01)
    band = np.exp(-0.5 * ((frequency - 1.32) / 0.25) ** 2)
    x = np.fft.irfft(np.fft.rfft(white) * band, T.size)
    result = analyse(track(0.02 * x / np.std(x)))
    assert isinstance(result.motion, Still)
    assert [finding.code for finding in result.findings if finding.severity == "error"] == ["no_oscillation"]


@pytest.mark.parametrize(
    "x",
    [0.05 * (T > 10.0), 0.02 * np.cumsum(np.random.default_rng(5).standard_normal(T.size)) / 10.0],
    ids=["a step", "a walk"],
)
def test_a_step_and_a_walk_are_refused(x: F8) -> None:
    """Their spectra have a largest line, and their periods are no sinusoids."""
    result = analyse(track(x))
    assert isinstance(result.motion, Still)
    assert "period" not in result.estimates
