"""The period of very small swings of hard and soft springs and of pendulums."""

from __future__ import annotations

import math
import os

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pipeline.analyse import Oscillation, analyse
from pipeline.motion.frequency import Change, amplitude_table, bends_of
from pipeline.numerics.regression import beyond, decompose
from pipeline.track import Track
from tests.trials.grades.graded import said_of

RECORDS = min(200, int(os.environ.get("SPRINGMASS_TRIALS", "24")))
PLAIN = 5.0  # standard uncertainties of the term in A^2 that a constant, t and t^2 do not explain

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

    def moves(_: float, z: np.ndarray) -> list[float]:
        pull = math.sin(z[0]) if pendulum else z[0] * (1.0 + cubic * z[0] ** 2)
        return [z[1], -square * pull - 2.0 * gamma * z[1]]

    x = solve_ivp(moves, (0.0, float(t[-1])), [start, 0.0], t_eval=t, rtol=1e-9, atol=1e-11).y[0]
    unit, noise = ("rad", 1e-3) if pendulum else ("m", 3e-4)
    track = Track.from_arrays(t, 0.3 + x + noise * rng.standard_normal(t.size), unit=unit)
    return track, math.tau / math.sqrt(square - gamma**2)


def _plain(motion: Oscillation) -> bool:
    """Return whether the term in A^2 is plain after a constant, t and t^2 of the frequency are projected out of it."""
    windows, phase = motion.windows, motion.phase
    if windows.t.size < 10 or phase.spread is None:
        return False
    kept = phase.spread.kept
    u = phase.spread.u[kept] * math.sqrt(phase.spread.correlation)
    best = motion.damping.best
    amplitude = amplitude_table(best.law, best.joint.values, phase.t0, float(windows.t[-1]))
    (table,) = bends_of(Change("amplitude", (2.0,)), amplitude, phase.middle)
    powers = np.vander((windows.t[kept] - phase.middle) / np.ptp(windows.t), 4) / u[:, None]
    term = beyond(decompose(powers)[0], (np.interp(windows.t[kept], *table) / u)[:, None])[:, 0]
    turned = (phase.total(windows.t) if phase.lag is None else windows.phase + np.interp(windows.t, *phase.lag))[kept]
    return abs(float(term @ (turned / u))) > PLAIN * math.sqrt(float(term @ term))


def test_the_period_of_very_small_swings_is_right_and_sound_where_the_change_is_plain() -> None:
    """No sound T_s is more than four u off, and where the change with the amplitude is plain 90 % of them are sound."""
    sound = []
    for seed in range(RECORDS):
        track, truth = _record(seed)
        analysis = analyse(track)
        said = said_of(analysis)
        assert said.wrong({"period_small_swings": truth}, 4.0) == {}, seed
        if isinstance(analysis.motion, Oscillation) and _plain(analysis.motion):
            small = said.values.get("period_small_swings")
            sound.append(small is not None and small.sound)
    assert len(sound) > RECORDS // 4
    assert np.mean(sound) >= 0.9
