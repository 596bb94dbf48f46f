"""The page states correctly how much longer to record."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from pipeline.bench.scene import Scene
from pipeline.track import Track
from springmass.page.live_analysis import motion_of

TRIALS = int(os.environ.get("SPRINGMASS_TRIALS", "12"))
CRYSTAL = 50e-6
"""Half-width of what the sensor's clock may be off; the page knows no more of it."""
LOOKS_S = np.concatenate([np.arange(4.0, 12.0, 1.0), np.geomspace(12.0, 60.0, 18)])
RATE_HZ = 50.0
EMPTY = Scene.from_mapping({})

pytestmark = pytest.mark.trials


def within(share: float) -> float:
    """Return the least share of the trials that is no proof against a probability: 3 binomial deviations below it."""
    return share - 3.0 * math.sqrt(share * (1.0 - share) / TRIALS)


@dataclass
class Bench:
    """A simulated bench: its motion by the sensor's clock, which is off by a share nobody knows."""

    truth: Any
    sigma_m: float
    clock: float
    noise: np.random.Generator
    synthetic: ModuleType

    def looks(
        self, seconds: np.ndarray, enough: Callable[[dict[str, Any]], bool]
    ) -> list[tuple[float, dict[str, Any]]]:
        """Return what the page tells after so many seconds each, up to where that is enough to whoever looks."""
        t = self.synthetic.times(float(seconds[-1]), RATE_HZ)
        y = self.truth.position(t * (1.0 - self.clock)) + self.sigma_m * self.noise.standard_normal(t.size)
        messages = []
        for end in seconds:
            n = round(end * RATE_HZ)
            track = Track(t[:n], y[:n], np.zeros(n, np.uint8), RATE_HZ, clock="device")
            messages.append((float(end), motion_of(track, EMPTY)))
            if "stop" in messages[-1][1] and enough(messages[-1][1]["stop"]):
                break
        return messages


def bench(synthetic: ModuleType, seed: int, laws: tuple[str, ...]) -> Bench:
    """Return a bench like those of the recordings; the seed says which."""
    rng = np.random.default_rng((18, seed))
    law = laws[seed % len(laws)]
    strength = rng.uniform(0.5, 2.0)
    truth = synthetic.Truth(
        amplitude=rng.uniform(0.02, 0.08),
        omega=2.0 * math.pi / rng.uniform(0.5, 1.2),
        phase=rng.uniform(-math.pi, math.pi),
        **{name: strength * value for name, value in synthetic.LAW_TRUTHS[law].items()},
    )
    return Bench(truth, rng.uniform(0.3e-3, 1e-3), rng.uniform(-CRYSTAL, CRYSTAL), rng.spawn(1)[0], synthetic)


def foretold(messages: list[tuple[float, dict[str, Any]]]) -> tuple[float, float] | None:
    """Return how much longer it was said to take for the wanted u, once no longer than so far, and how much it was."""
    shown = [(t, m["stop"]) for t, m in messages if "stop" in m]
    reached = next((i for i, (_, stop) in enumerate(shown) if stop["more_s"] == 0.0), None)
    if not reached:
        return None
    (before_s, before), (after_s, after) = shown[reached - 1], shown[reached]
    wanted = math.sqrt(after["wanted_u_s"] ** 2 - after["u_clock_s"] ** 2)
    u = [math.log(each["u_samples_s"]) for each in (before, after)]
    share = (u[0] - math.log(wanted)) / (u[0] - u[1])
    at = math.exp(math.log(before_s) + share * math.log(after_s / before_s))
    for t, stop in shown[:reached]:
        if stop["more_s"] is not None and stop["more_s"] <= t:
            return stop["more_s"], at - t
    return None


def test_the_time_foretold_comes_true(synthetic: ModuleType) -> None:
    """It is right within 20 % on 95 % of the benches, from when it is no longer than the recording so far."""
    times = []
    for seed in range(TRIALS):
        each = bench(synthetic, seed, ("linear", "quadratic", "linear+quadratic"))
        messages = each.looks(LOOKS_S, lambda stop: stop["more_s"] == 0.0)
        if (pair := foretold(messages)) is not None:
            times.append(pair)
    predicted, took = np.array(times).T
    right = np.abs(predicted / took - 1.0) <= 0.2
    print(
        f"{TRIALS} benches: of {right.size} times foretold {right.mean():.3f} within 20 %, "
        f"ratio {np.quantile(predicted / took, [0.025, 0.5, 0.975])}"
    )
    assert right.size >= 0.5 * TRIALS
    assert right.mean() >= within(0.95)
