"""Stuck bits and interpolated samples: numbers stay within their u, or a warning names the cause."""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest

from pipeline.analyse import analyse
from pipeline.track import F8, Track

TRIALS = int(os.environ.get("SPRINGMASS_TRIALS", "40"))
NAMES = {
    *("model_misfit", "not_sinusoidal", "smoothed_sensor", "held_samples", "quantised", "sideways_mode", "clipped"),
    *("two_modes", "no_oscillation"),
}
RATE_HZ = 100.0

pytestmark = pytest.mark.trials


class Bench:
    """One weakly damped bob of random size, period, damping and noise."""

    def __init__(self, shape: str, seed: int) -> None:
        self.rng = np.random.default_rng([113, *shape.encode(), seed])
        self.period, self.amplitude = self.rng.uniform(0.5, 1.5), self.rng.uniform(0.03, 0.08)
        self.seconds = float(self.rng.choice([20, 40, 60]))
        self.rate = self.rng.uniform(0.2, 1.5) / self.seconds
        self.sigma_m = float(self.rng.choice([1e-4, 3.5e-4]))
        self.phase = self.rng.uniform(0.0, 2.0 * math.pi)
        self.t = np.arange(int(RATE_HZ * self.seconds)) / RATE_HZ

    def at(self, t: F8) -> F8:
        """Return the displacement at times (n,), m."""
        return self.amplitude * np.exp(-self.rate * t) * np.cos(2.0 * math.pi * t / self.period + self.phase)

    def noise(self, size: int | None = None) -> F8:
        """Return white noise (n,), m."""
        return self.sigma_m * self.rng.standard_normal(size or self.t.size)


def interpolated(b: Bench) -> F8:
    """Return a slow sensor's distances, joined by straight lines."""
    slow = np.arange(0.0, b.seconds + 1.0, 1.0 / b.rng.uniform(8.0, 25.0))
    return np.interp(b.t, slow, 0.3 + b.at(slow) + b.noise(slow.size))


def interpolated_and_printed(b: Bench) -> F8:
    """Return a slow sensor's distances, joined by straight lines and rounded to 0.1 mm."""
    return np.round(interpolated(b), 4)


def stuck_high(b: Bench) -> F8:
    """Return distances in steps of 1/8 mm of which one bit of 1 to 8 mm is always set."""
    counts = np.round((0.3 + b.at(b.t) + b.noise()) * 8000.0).astype(np.int64)
    bit = 1 << int(b.rng.integers(3, 7))
    return (counts | bit) / 8000.0


REACHED = (stuck_high, interpolated, interpolated_and_printed)


@pytest.mark.parametrize("shape", REACHED, ids=lambda shape: shape.__name__)
def test_numbers_hold_or_the_cause_is_named(shape: Callable[[Bench], F8]) -> None:
    """Of one record in twenty at most a number is off by more than four u without a warning."""
    wrong, right, by, codes = 0, 0, Counter[str](), Counter[str]()
    for seed in range(TRIALS):
        bench = Bench(shape.__name__, seed)
        found = analyse(Track.from_arrays(bench.t, shape(bench)))
        warnings = {finding.code for finding in found.findings if finding.severity != "info"}
        codes.update(warnings)
        truth = {"period": bench.period, "amplitude": bench.amplitude, "damping_rate": bench.rate}
        off = {
            name
            for name, value in truth.items()
            if name in found.estimates and abs(found.estimates[name].value - value) > 4.0 * found.estimates[name].u
        }
        right += not off
        if off and not warnings & NAMES:
            wrong += 1
            by.update(off)
    print(f"\n{shape.__name__}: {TRIALS} records, {right} right, {wrong} wrong and not named {dict(by)}; {dict(codes)}")
    assert wrong <= 0.05 * TRIALS
