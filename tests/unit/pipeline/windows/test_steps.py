"""Jumps of the rest position are counted, placed to the sample and told from drift."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import numpy as np
import pytest

from pipeline.analyse import Oscillation, analyse
from pipeline.numerics.estimate import Estimate
from pipeline.samples.condition import condition
from pipeline.track import Track
from pipeline.windows.cycles import Cycles, find_cycles
from pipeline.windows.demodulate import demodulate
from pipeline.windows.steps import Step, find_steps, staircase

F8 = np.ndarray


def steps_of(
    synthetic: ModuleType, rest: Callable[[F8], F8], seconds: float, sigma_m: float, seed: int
) -> tuple[Step, ...]:
    """Return the steps found in a run whose rest position is this function of time."""
    t = synthetic.times(seconds)
    y = synthetic.noisy(synthetic.Truth(gamma=0.01463), t, sigma_m, seed) + rest(t)
    conditioned = condition(Track.from_arrays(t, y))
    cycles = find_cycles(conditioned)
    assert isinstance(cycles, Cycles)
    return find_steps(conditioned, demodulate(conditioned, cycles))


@pytest.mark.parametrize("height_m", [1.5e-3, -1.5e-3])
@pytest.mark.parametrize("seconds", [30.0, 120.0])
def test_step_is_placed_and_measured(synthetic: ModuleType, height_m: float, seconds: float) -> None:
    """One jump of 1.5 mm is found where it is, to two samples, and as high as it is."""
    at = 0.4 * seconds + 0.123
    (step,) = steps_of(synthetic, lambda t: height_m * (t >= at), seconds, 3e-4, 1)
    assert step.time.value == pytest.approx(at, abs=0.02)
    assert step.height.value == pytest.approx(height_m, abs=4 * step.height.u)
    assert step.height.u < 1e-4
    assert step.false_alarm < 1e-4


def test_several_steps_up_and_down(synthetic: ModuleType) -> None:
    """Jumps that undo each other are all found: correlation of what fewer of them leave does not hide them."""
    at, heights = (30.0, 60.5, 86.2), (1.5e-3, -1.5e-3, 1.5e-3)
    found = steps_of(synthetic, lambda t: sum(h * (t >= s) for s, h in zip(at, heights, strict=True)), 120.0, 3e-4, 2)
    np.testing.assert_allclose([step.time.value for step in found], at, atol=0.03)
    np.testing.assert_allclose([step.height.value for step in found], heights, atol=1.5e-4)


@pytest.mark.parametrize(
    "rest",
    [
        lambda t: 0.0 * t,
        lambda t: 1e-3 * t / 120.0,
        lambda t: 3e-3 * (t / 120.0) ** 2,
        lambda t: 1e-3 * np.exp(-t / 20.0),
        lambda t: 1e-3 * np.sin(2 * np.pi * t / 40.0),
        lambda t: 1e-3 / (1.0 + np.exp(-(t - 60.0) / 3.0)),
    ],
    ids=["none", "line", "parabola", "creep", "wave", "glide"],
)
def test_drift_is_no_staircase(synthetic: ModuleType, rest: Callable[[F8], F8]) -> None:
    """A rest position that stays, drifts, creeps, sways or glides does not jump."""
    assert [steps_of(synthetic, rest, 120.0, 3e-4, seed) for seed in range(3)] == [(), (), ()]


def test_step_upon_drift(synthetic: ModuleType) -> None:
    """Drift and a jump are told apart in one record."""
    (step,) = steps_of(synthetic, lambda t: 1e-3 * (t / 120.0) ** 2 + 1.5e-3 * (t >= 50.0), 120.0, 3e-4, 3)
    assert step.time.value == pytest.approx(50.0, abs=0.02)


def test_analysis_follows_steps(synthetic: ModuleType) -> None:
    """With the jumps taken out the period is as sharp as without them, and the rest position follows them."""
    t = synthetic.times(60.0)
    truth = synthetic.Truth(gamma=0.01463)
    clean = synthetic.noisy(truth, t, 3e-4, 1)
    jumps = 1.5e-3 * (t >= 20.0) - 1e-3 * (t >= 41.0)
    motion, alone = (analyse(Track.from_arrays(t, y)).motion for y in (clean + jumps, clean))
    assert isinstance(motion, Oscillation)
    assert isinstance(alone, Oscillation)
    assert len(motion.rest.steps) == 2
    assert not motion.rest.drifts
    assert motion.rest.moves
    assert motion.rest.range_m == pytest.approx(1.5e-3, rel=0.1)
    assert motion.derived.statistical["period"].u < 1.2 * alone.derived.statistical["period"].u
    assert motion.waveform.rms_m == pytest.approx(3e-4, rel=0.05)
    away = np.abs(motion.rest.at(t) - truth.offset - jumps)
    assert np.median(away) < 3e-5
    mean = motion.rest.mean
    assert mean.value == pytest.approx(truth.offset + jumps.mean(), abs=4 * mean.u)


def test_short_record_does_not_jump(synthetic: ModuleType) -> None:
    """Under eight windows no jump is found."""
    assert steps_of(synthetic, lambda t: 1e-3 * (t >= 2.0), 4.5, 3e-4, 1) == ()


def test_staircase_adds_up(synthetic: ModuleType) -> None:
    """Steps add from their times on, and leave the distances when taken out."""
    steps = tuple(Step(Estimate(at, 0.01, "s"), Estimate(h, 1e-5, "m"), 0.0) for at, h in ((1.0, 2e-3), (3.0, -5e-3)))
    np.testing.assert_allclose(staircase(steps, np.array([0.0, 1.0, 2.0, 3.0])), [0.0, 2e-3, 2e-3, -3e-3])
    t = synthetic.times(5.0)
    conditioned = condition(Track.from_arrays(t, synthetic.Truth().position(t)))
    np.testing.assert_allclose(conditioned.less(staircase(steps, t)).track.y, conditioned.track.y - staircase(steps, t))
