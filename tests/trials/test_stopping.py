"""The page states correctly how much longer to record."""

import math
import os
from typing import Any

import numpy as np
import pytest

from acquisition.block import Block, SourceInfo
from springmass.loading.options import AnalysisOptions
from springmass.page.live_analysis import motion_message
from springmass.runs.rolling import analysed, live_run
from tests.synthetic import LAW_TRUTHS, Truth, times

TRIALS = int(os.environ.get("SPRINGMASS_TRIALS", "12"))
CRYSTAL = 50e-6
"""Half-width of what the sensor's clock may be off; the page knows no more of it."""
LOOKS_S = np.concatenate([np.arange(4.0, 12.0, 1.0), np.geomspace(12.0, 60.0, 18)])
RATE_HZ = 50.0

pytestmark = pytest.mark.trials


def looks(seed: int) -> list[tuple[float, dict[str, Any]]]:
    """Return what the page says of a bench after each of some durations, until it needs no more samples.

    The bench is like those of the recordings, and its sensor's clock is off by a share that nobody knows.
    """
    rng = np.random.default_rng((18, seed))
    law = ("linear", "quadratic", "linear+quadratic")[seed % 3]
    strength = rng.uniform(0.5, 2.0)
    truth = Truth(
        amplitude=rng.uniform(0.02, 0.08),
        omega=2.0 * math.pi / rng.uniform(0.5, 1.2),
        phase=rng.uniform(-math.pi, math.pi),
        **{name: strength * value for name, value in LAW_TRUTHS[law].items()},
    )
    t = times(float(LOOKS_S[-1]), RATE_HZ)
    sigma_m, clock = rng.uniform(0.3e-3, 1e-3), rng.uniform(-CRYSTAL, CRYSTAL)
    y = truth.position(t * (1.0 - clock)) + sigma_m * rng.spawn(1)[0].standard_normal(t.size)
    messages = []
    for end in LOOKS_S:
        n = round(end * RATE_HZ)
        samples, info = Block(0, t[:n], y[:n], np.zeros(n, np.uint8)), SourceInfo("live", "", RATE_HZ, clock="device")
        run = live_run(samples, info, None, {}, AnalysisOptions(accuracy="fast"))
        messages.append((float(end), motion_message(analysed(run))))
        if messages[-1][1].get("stop", {}).get("more_s") == 0.0:
            break
    return messages


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


def test_the_time_foretold_comes_true() -> None:
    """It is right within 20 % on 95 % of the benches, from when it is no longer than the recording so far."""
    pairs = [pair for seed in range(TRIALS) if (pair := foretold(looks(seed))) is not None]
    assert len(pairs) >= 0.5 * TRIALS
    predicted, took = np.array(pairs).T
    least = 0.95 - 3.0 * math.sqrt(0.95 * 0.05 / TRIALS)  # no proof against 95 % within three binomial deviations
    assert np.mean(np.abs(predicted / took - 1.0) <= 0.2) >= least
