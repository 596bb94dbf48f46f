"""Who watches the page and stops when he likes is told the truth: intervals, and how much longer to record."""

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
from springmass.page.stopping import widening

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


def stopped(messages: list[tuple[float, dict[str, Any]]], wish_s: float) -> dict[str, Any] | None:
    """Return what stands on the page where somebody stops who wishes for a value and for a small uncertainty."""
    stop = None
    for _, message in messages:
        if "stop" not in message:
            continue
        stop, value = message["stop"], message["estimates"]["period"]["value"]
        if stop["u_s"] <= stop["wanted_u_s"] or abs(value - wish_s) <= 0.3 * stop["u_s"]:
            return {**stop, "value": value}
    return None if stop is None else {**stop, "value": value}


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


def test_intervals_hold_for_those_who_stop_when_they_like(synthetic: ModuleType) -> None:
    """95 % intervals cover at the stop, with the clock and without it; the time foretold for u(T) comes true."""
    held, held_samples, two_u, times = [], [], [], []
    for seed in range(TRIALS):
        each = bench(synthetic, seed, ("linear", "quadratic", "linear+quadratic"))
        messages = each.looks(LOOKS_S, lambda stop: stop["more_s"] == 0.0)
        seen = each.truth.period * (1.0 + each.clock)  # the clock runs fast: it counts more seconds a swing
        wish = seen * (1.0 + 1e-4 * np.random.default_rng((19, seed)).standard_normal())
        stop = stopped(messages, wish)
        assert stop is not None
        held.append(stop["low"] <= each.truth.period <= stop["high"])
        wanted = math.sqrt(stop["wanted_u_s"] ** 2 - stop["u_clock_s"] ** 2)
        error = abs(stop["value"] - seen)
        held_samples.append(error <= widening(stop["u_samples_s"], wanted) * stop["u_samples_s"])
        two_u.append(error <= 2.0 * stop["u_samples_s"])
        if (pair := foretold(messages)) is not None:
            times.append(pair)
    predicted, took = np.array(times).T
    right = np.abs(predicted / took - 1.0) <= 0.2
    print(
        f"{TRIALS} benches: at the stop the interval covers {np.mean(held):.4f}, that of the samples alone "
        f"{np.mean(held_samples):.4f}, two u of them {np.mean(two_u):.4f}; of {right.size} times foretold "
        f"{right.mean():.3f} within 20 %, ratio {np.quantile(predicted / took, [0.025, 0.5, 0.975])}"
    )
    assert np.mean(held) >= within(0.94)
    assert np.mean(held_samples) >= within(0.94)
    assert right.size >= 0.5 * TRIALS
    assert right.mean() >= within(0.95)
