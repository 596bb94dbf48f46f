"""The rate of the device's clock against the host's, and what stalls, bursts and restarts do to it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from acquisition.live.clock_fit import ClockFit, fit_clock

RATE_HZ = 100.0
SECOND_NS = 1_000_000_000


JITTERS: dict[str, Callable[[np.random.Generator, int], np.ndarray]] = {
    "uniform": lambda rng, n: rng.uniform(0.0, 0.020, n),
    "exponential": lambda rng, n: rng.exponential(0.020, n),
    "half-normal": lambda rng, n: np.abs(rng.normal(0.0, 0.020, n)),
}


@pytest.mark.parametrize("jitter", JITTERS)
def test_clock_rate_is_recovered_under_host_jitter(jitter: str) -> None:
    """Two minutes at 100 Hz with stamps up to 20 ms late give the crystal's error within 5 ppm, with an honest u."""
    t = np.arange(12_000) / RATE_HZ
    errors, z = [], []
    for seed in range(100):
        rng = np.random.default_rng([seed, len(jitter)])
        ppm = float(rng.uniform(-100.0, 100.0))
        true = t / (1.0 + ppm * 1e-6)
        host = np.round((true + JITTERS[jitter](rng, t.size)) * 1e9).astype(np.int64)
        fit = fit_clock(t, 3 * SECOND_NS + host)
        errors.append(fit.rate_error_ppm - ppm)
        z.append(errors[-1] / fit.u_rate_error_ppm)
        assert 0.002 < fit.jitter_s < 0.03
    assert np.max(np.abs(errors)) < 5.0
    assert 0.8 < np.std(z) < 1.25
    assert abs(np.mean(z)) < 0.4


def test_clock_rate_with_scatter_to_both_sides() -> None:
    """Where stamps scatter to both sides the error stays within its stated uncertainty."""
    t = np.arange(12_000) / RATE_HZ
    z = []
    for seed in range(40):
        host = np.round((t + np.random.default_rng(seed).normal(0.0, 1e-3, t.size)) * 1e9).astype(np.int64)
        fit = fit_clock(t, host)
        z.append(fit.rate_error_ppm / fit.u_rate_error_ppm)
    assert 0.6 < np.std(z) < 1.5


@pytest.mark.parametrize("seconds", [5, 30, 300])
def test_a_clock_rate_is_covered_by_its_uncertainty_however_short_the_run(seconds: int) -> None:
    """From five seconds on, 68 and 95 % intervals cover as they claim: a dozen stretches tell their scatter badly."""
    t = np.arange(seconds * 100) / RATE_HZ
    z = []
    for seed in range(200):
        rng = np.random.default_rng([seed, seconds])
        ppm = float(rng.uniform(-100.0, 100.0))
        host = np.round((t / (1.0 + ppm * 1e-6) + rng.exponential(1e-3, t.size)) * 1e9).astype(np.int64)
        fit = fit_clock(t, host)
        z.append((fit.rate_error_ppm - ppm) / fit.u_rate_error_ppm)
    assert np.mean(np.abs(z) < 1.0) == pytest.approx(0.683, abs=0.10)
    assert np.mean(np.abs(z) < 1.96) == pytest.approx(0.95, abs=0.04)


def test_too_few_readings_say_nothing_of_the_clock() -> None:
    """Below 24 readings, or with all of them at one time, the rate error is unknown and its u infinite."""
    for t in (np.arange(23.0), np.zeros(40)):
        fit = fit_clock(t, np.arange(t.size, dtype=np.int64))
        assert math.isnan(fit.rate_error_ppm)
        assert math.isinf(fit.u_rate_error_ppm)


def test_two_bunches_of_readings_claim_no_certainty() -> None:
    """Readings at the two ends alone do not make a line without scatter."""
    rng = np.random.default_rng(5)
    t = np.concatenate([np.arange(200), 10_000 + np.arange(200)]) / RATE_HZ
    fit = fit_clock(t, np.round((t + rng.exponential(0.02, t.size)) * 1e9).astype(np.int64))
    assert fit.u_rate_error_ppm > 1.0
    assert abs(fit.rate_error_ppm) < 5.0 * fit.u_rate_error_ppm
