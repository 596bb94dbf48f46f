"""The period of very small swings of hard and soft springs and of pendulums."""

import math
import os

import numpy as np
import pytest

from pipeline.analyse import analyse
from pipeline.track import Track
from tests.synthetic import solved
from tests.trials.grades.graded import said_of

RECORDS = min(200, int(os.environ.get("SPRINGMASS_TRIALS", "24")))
pytestmark = pytest.mark.trials


def _record(seed: int) -> tuple[Track, float]:
    """Return a spring with a cubic term or a pendulum in turn, and its period of very small swings."""
    rng = np.random.default_rng([76, seed])
    gamma, seconds = (math.exp(rng.uniform(*np.log(ends))) for ends in ((0.004, 0.06), (20.0, 120.0)))
    t = np.arange(0.0, seconds, 0.02)
    pendulum = bool(seed % 2)
    square = 9.81 / rng.uniform(0.4, 1.2) if pendulum else rng.uniform(40.0, 80.0)
    cubic = rng.uniform(2.0, 40.0) * (1.0 if rng.random() < 0.6 else -0.3)
    start = math.radians(rng.uniform(8.0, 50.0)) if pendulum else rng.uniform(0.03, 0.07)
    pull = math.sin if pendulum else lambda x: x * (1.0 + cubic * x**2)
    x, _ = solved(lambda _, x, v: -square * pull(x) - 2.0 * gamma * v, start, t)
    unit, noise = ("rad", 1e-3) if pendulum else ("m", 3e-4)
    track = Track.from_arrays(t, 0.3 + x + noise * rng.standard_normal(t.size), unit=unit)
    return track, math.tau / math.sqrt(square - gamma**2)


def test_the_period_of_very_small_swings_is_right_and_often_sound() -> None:
    """No sound T_s is more than four u off, and half of them are sound."""
    sound = 0
    for seed in range(RECORDS):
        track, truth = _record(seed)
        said = said_of(analyse(track))
        assert said.wrong({"period_small_swings": truth}, 4.0) == {}, seed
        sound += "period_small_swings" in said.values and said.values["period_small_swings"].sound
    print(f"{sound} of {RECORDS} are sound")
    assert sound >= 0.5 * RECORDS
