"""The rate of the device's clock against the host's, and what stalls, bursts and restarts do to it."""

from collections.abc import Callable

import numpy as np
import pytest

from acquisition.live.clock_fit import fit_clock
from tests.sampling import sampled

RATE_HZ = 100.0
SECOND_NS = 1_000_000_000


JITTERS: dict[str, Callable[[np.random.Generator, int], np.ndarray]] = {
    "uniform": lambda rng, n: rng.uniform(0.0, 0.020, n),
    "exponential": lambda rng, n: rng.exponential(0.020, n),
    "half-normal": lambda rng, n: np.abs(rng.normal(0.0, 0.020, n)),
}


@pytest.mark.parametrize("seeds", sampled([8, 100], 1))
@pytest.mark.parametrize("jitter", JITTERS)
def test_clock_rate_is_recovered_under_host_jitter(jitter: str, seeds: int) -> None:
    """Two minutes at 100 Hz with stamps up to 20 ms late give the crystal's error within 5 ppm, with an honest u."""
    t = np.arange(12_000) / RATE_HZ
    errors, z = [], []
    for seed in range(seeds):
        rng = np.random.default_rng([seed, len(jitter)])
        ppm = float(rng.uniform(-100.0, 100.0))
        true = t / (1.0 + ppm * 1e-6)
        host = np.round((true + JITTERS[jitter](rng, t.size)) * 1e9).astype(np.int64)
        fit = fit_clock(t, 3 * SECOND_NS + host)
        errors.append(fit.rate_error_ppm - ppm)
        z.append(errors[-1] / fit.u_rate_error_ppm)
        assert 0.002 < fit.host_jitter_s < 0.03
    assert np.max(np.abs(errors)) < 5.0
    assert np.max(np.abs(z)) < 4.0
    if seeds == 100:
        assert 0.8 < np.std(z) < 1.25
        assert abs(np.mean(z)) < 0.4


@pytest.mark.parametrize("seconds", sampled([5, 30, 300]))
def test_a_clock_rate_is_covered_by_its_uncertainty_however_short_the_run(seconds: int) -> None:
    """From five seconds on, 68 and 95 % intervals have their nominal coverage, even with few degrees of freedom."""
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


def stamped(true_s: np.ndarray, *stalls: tuple[float, float], seed: int = 1) -> np.ndarray:
    """Return host times in ns of readings that are a millisecond late, or come together at the end of a stall."""
    host = true_s + np.random.default_rng(seed).exponential(1e-3, true_s.size)
    for start, stop in stalls:
        host[(true_s >= start) & (true_s < stop)] = stop + 1e-3
    return np.round(np.maximum.accumulate(host) * 1e9).astype(np.int64)


@pytest.mark.parametrize("ppm", sampled([-30_000.0, 40.0, -3000.0, 5000.0]))
@pytest.mark.parametrize("stall", [(2.0, 15.0), (-1.0, 13.0), (7.0, 21.0), (9.0, 9.5)])
def test_a_stall_says_nothing_of_the_clock(stall: tuple[float, float], ppm: float) -> None:
    """Readings that came together after a silence are counted and left out, wherever the silence was."""
    t = np.arange(2000) / RATE_HZ
    fit = fit_clock(t, stamped(t / (1.0 + ppm * 1e-6), stall))
    held = np.count_nonzero((t >= stall[0]) & (t < stall[1]))
    assert fit.rate_error_ppm == pytest.approx(ppm, abs=60.0)
    assert fit.stalls == 1
    assert fit.held_readings == pytest.approx(held, abs=0.05 * held + 3)
    assert fit.longest_stall_s == pytest.approx(min(stall[1], 20.0) - max(stall[0], 0.0), rel=0.05)


@pytest.mark.parametrize("step_s", [-6.0, -0.1, 0.1, 30.0])
def test_a_jump_that_stays_is_no_rate(step_s: float) -> None:
    """After a host slept or a device restarted, the lines on either side have one slope and different offsets."""
    t = np.arange(6000) / RATE_HZ
    host = stamped(t / (1.0 + 50e-6)) + np.where(t > 21.0, round(step_s * 1e9), 0)
    fit = fit_clock(t, host)
    assert (fit.steps, fit.stalls) == (1, 0)
    assert fit.rate_error_ppm == pytest.approx(50.0, abs=5.0)
    assert fit.span_s == pytest.approx(39.0, abs=1.5)


@pytest.mark.parametrize("true_hz", [20.0, 99.0, 500.0])
def test_a_rate_that_is_wrong_by_a_multiple_is_no_stall(true_hz: float) -> None:
    """A counter over a nominal 100 Hz that runs at another rate: every stamp tells it."""
    number = np.arange(3000)
    fit = fit_clock(number / RATE_HZ, stamped(number / true_hz))
    assert fit.stalls == 0
    assert fit.rate_error_ppm == pytest.approx((true_hz / RATE_HZ - 1.0) * 1e6, abs=100.0)
