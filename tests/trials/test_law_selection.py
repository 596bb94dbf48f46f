"""Of records with known damping the right law is picked in two minutes, and admissible in half a minute."""

from __future__ import annotations

import math
import os
from collections import Counter
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from pipeline.analyse import Oscillation, analyse
from pipeline.track import Track

TRIALS = int(os.environ.get("SPRINGMASS_TRIALS", "30"))
SINGLE = ("linear", "quadratic", "friction")
MIXED = ("linear+quadratic", "linear+friction", "quadratic+friction")
FINE_M, COARSE_M = 3e-4, 2.39e-3

pytestmark = pytest.mark.trials


def runs(synthetic: ModuleType, name: str, seconds: float, sigma_m: float) -> list[Any]:
    """Return the damping found in runs of one truth that differ in noise and phase."""
    t = synthetic.times(seconds)
    amplitude = synthetic.Truth(**synthetic.LAW_TRUTHS[name]).amplitude_at(t)
    found = []
    for seed in range(TRIALS):
        rng = np.random.default_rng((seed, 11))
        y = 0.22 + amplitude * np.cos(8.3 * t + rng.uniform(-math.pi, math.pi)) + sigma_m * rng.standard_normal(t.size)
        motion = analyse(Track.from_arrays(t, y)).motion
        assert isinstance(motion, Oscillation)
        found.append(motion.damping)
    return found


def at_least(count: int, share: float) -> bool:
    """Whether a count of all trials is no less than a share, but for 3.3 binomial standard deviations."""
    return count >= TRIALS * share - 3.3 * math.sqrt(TRIALS * share * (1.0 - share))


@pytest.mark.parametrize(
    ("name", "sigma_m", "share"),
    [
        *((name, sigma_m, 0.95) for name in SINGLE for sigma_m in (FINE_M, COARSE_M)),
        *((name, FINE_M, 0.95) for name in [*MIXED, "power"]),
        *((name, COARSE_M, 0.70) for name in MIXED),
        ("power", COARSE_M, 0.45),
    ],
)
def test_true_law_is_picked_in_two_minutes(synthetic: ModuleType, name: str, sigma_m: float, share: float) -> None:
    """Of 120 s single laws are picked in 95 % of runs, mixtures at 0.3 mm too, and in 70 % at 2.39 mm."""
    found = runs(synthetic, name, 120.0, sigma_m)
    picked = Counter(damping.selected for damping in found)
    admitted = sum(name in damping.admissible for damping in found)
    rejected = sum(damping.fits[name].rejected for damping in found)
    alone = sum(damping.settled for damping in found)
    line = (
        f"120 s, {sigma_m * 1e3:g} mm, {name}: picked {picked[name] / TRIALS:.3f}, admissible {admitted / TRIALS:.3f}, "
        f"alone {alone / TRIALS:.3f}, rejected {rejected / TRIALS:.4f}; {dict(picked)}"
    )
    print(line)
    assert at_least(picked[name], share), line
    assert at_least(admitted, 0.95), line
    assert at_least(TRIALS - rejected, 0.98), line


@pytest.mark.parametrize("sigma_m", [FINE_M, COARSE_M])
@pytest.mark.parametrize("name", [*SINGLE, *MIXED, "power"])
def test_true_law_is_admissible_in_half_a_minute(synthetic: ModuleType, name: str, sigma_m: float) -> None:
    """Of 30 s, which cannot tell mixtures apart, the set of admissible laws holds the true one in 95 % of runs."""
    found = runs(synthetic, name, 30.0, sigma_m)
    admitted = sum(name in damping.admissible for damping in found)
    size = float(np.mean([len(damping.admissible) for damping in found]))
    line = f"30 s, {sigma_m * 1e3:g} mm, {name}: admissible {admitted / TRIALS:.3f}, {size:.1f} laws in the set"
    print(line)
    assert at_least(admitted, 0.95), line


def test_an_exponential_is_rejected_where_it_is_wrong_and_only_there(synthetic: ModuleType) -> None:
    """At 2.39 mm and 120 s one exponential is rejected on 99 % of quadratic records and 2 % of linear ones."""
    wrong = sum(d.fits["linear"].rejected for d in runs(synthetic, "quadratic", 120.0, COARSE_M))
    right = sum(d.fits["linear"].rejected for d in runs(synthetic, "linear", 120.0, COARSE_M))
    line = f"one exponential rejected on {wrong / TRIALS:.4f} of quadratic and {right / TRIALS:.4f} of linear records"
    print(line)
    assert at_least(wrong, 0.99), line
    assert at_least(TRIALS - right, 0.98), line
