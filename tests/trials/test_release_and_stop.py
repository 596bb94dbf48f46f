"""Records that begin with a held bob, and end where friction has stopped it: parts of a record, no reason to refuse."""

from __future__ import annotations

import math
import os
from collections import Counter

import numpy as np
import pytest

from pipeline.analyse import Analysis, analyse
from pipeline.track import F8, Track
from tests.trials.test_friction_phase import half_cycles

TRIALS = int(os.environ.get("SPRINGMASS_TRIALS", "60"))
SHAPES = ("held", "rests, is lifted and held", "held, stops", "held by a trembling hand")
NAMES = {"model_misfit", "handled", "restarted", "touched", "phase_jump", "no_oscillation", "not_converged"}

pytestmark = pytest.mark.trials


def release(shape: str, seed: int) -> tuple[F8, F8, float]:
    """Return times, distances and the period of a bob that is released once."""
    rng = np.random.default_rng([91, SHAPES.index(shape), seed])
    period, start = rng.uniform(0.5, 1.5), rng.uniform(0.03, 0.08)
    seconds, held = float(rng.choice([20, 40, 60])), rng.uniform(1.5, 12.0)
    omega = 2.0 * math.pi / period
    t = np.arange(int(100 * seconds)) / 100.0
    if shape == "held, stops":
        moves = rng.uniform(0.4, 0.9) * (seconds - held)
        free = half_cycles(np.maximum(t - held, 0.0), omega, start, 0.25 * start * period / moves, 0.0)
    else:
        rate = rng.uniform(0.005, 0.04)
        free = start * np.exp(-rate * (t - held)) * np.cos(math.sqrt(omega**2 - rate**2) * (t - held))
    hand = np.full(t.size, start)
    if shape == "rests, is lifted and held":
        hand *= np.clip((t - 0.3 * held) / 0.8, 0.0, 1.0)
        held = max(held, 0.3 * held + 0.8 + 1.5 * period)
        free = start * np.exp(-0.01 * (t - held)) * np.cos(math.sqrt(omega**2 - 1e-4) * (t - held))
    elif shape == "held by a trembling hand":
        hand += 0.01 * start * np.sin(2.0 * math.pi * 7.0 * t) + 0.02 * start * np.sin(1.3 * t)
    noise = float(rng.choice([1e-4, 4e-4])) * rng.standard_normal(t.size)
    return t, 0.3 + np.where(t < held, hand, free) + noise, period


def error_of(found: Analysis, period: float) -> float:
    """Return by how many stated uncertainties the period is off; infinite where there is none."""
    stated = found.estimates.get("period")
    return math.inf if stated is None else abs(stated.value - period) / stated.u


@pytest.mark.parametrize("shape", SHAPES)
def test_released_bobs_are_analysed(shape: str) -> None:
    """None is refused, and of one in twenty at most the period is wrong and no finding says so."""
    refused, wrong, codes = 0, 0, Counter[str]()
    for seed in range(TRIALS):
        t, y, period = release(shape, seed)
        found = analyse(Track.from_arrays(t, y))
        warnings = {finding.code for finding in found.findings if finding.severity != "info"}
        codes.update(warnings)
        refused += "period" not in found.estimates
        wrong += 4.0 < error_of(found, period) < math.inf and not warnings & NAMES
    print(f"\n{shape}: {TRIALS} records, {refused} refused, {wrong} wrong and not named; {dict(codes)}")
    assert refused == 0
    assert wrong <= 0.05 * TRIALS
