"""The rules that every source keeps; a new one joins by adding a maker to ``SOURCES``."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from acquisition.block import Block, Flag, SourceInfo, concatenate
from acquisition.clock import Clock, VirtualClock
from acquisition.replay import Replay
from acquisition.simulated import VirtualRangefinder, VirtualSensor

SECONDS = 120
RATE_HZ = 100.0


def run() -> Block:
    """Return two minutes at 100 Hz with a few samples missing."""
    t = np.arange(SECONDS * int(RATE_HZ)) / RATE_HZ
    distance = 0.25 + 0.05 * np.sin(7.9 * t) + 1e-4 * np.random.default_rng(1).standard_normal(t.size)
    flags = np.zeros(t.size, np.uint8)
    distance[500:510] = np.nan
    flags[500:510] = Flag.MISSING
    return Block(0, t, distance, flags, None, np.gradient(distance, t))


def replay(speed: float | None) -> Callable[[Clock], Replay]:
    """Return a maker of replays at a speed."""
    info = SourceInfo("replay", "run", RATE_HZ, quantum_m=1e-5)
    return lambda clock: Replay(run(), clock, info=info, speed=speed)


def simulated(clock: Clock) -> Replay:
    """Return a simulated source with noise, false echoes and readings without a target."""
    sensor = VirtualSensor(rate_hz=RATE_HZ, false_echo_rate_hz=0.5, dead_time_s=1.17e-3)
    bob = VirtualRangefinder(lambda t: 0.25 + 0.05 * math.sin(7.9 * t), sensor, np.random.default_rng(1))
    return Replay(bob.block(SECONDS), clock, info=bob.info("run"))


REPLAYS = {"replay-1x": replay(1.0), "replay-10x": replay(10.0), "replay-max": replay(None)}
"""Makers of sources that deliver :func:`run`."""
SOURCES = {**REPLAYS, "simulated": simulated}
"""Makers of sources that deliver two minutes at 100 Hz."""
PACE = {"replay-10x": 10.0, "replay-max": math.inf}
"""Of the others it is that of the run."""

every_source = pytest.mark.parametrize("name", SOURCES)
every_replay = pytest.mark.parametrize("name", REPLAYS)


@every_replay
def test_samples_are_those_of_the_run_bit_for_bit(name: str) -> None:
    """Whatever the pace, the samples are the same."""
    with SOURCES[name](VirtualClock()) as source:
        joined = concatenate(source)
    for column in ("t", "distance", "flags", "velocity"):
        assert getattr(joined, column).tobytes() == getattr(run(), column).tobytes()
    assert joined.host_ns is None


@every_source
def test_blocks_follow_each_other_without_a_hole(name: str) -> None:
    """Each block begins where the one before ended, and none is empty."""
    with SOURCES[name](VirtualClock()) as source:
        expected = 0
        for block in source:
            assert isinstance(block, Block)
            assert block.first == expected
            assert len(block) > 0
            expected += len(block)
    assert expected == len(run())


@every_source
def test_it_takes_the_clock_time_of_its_pace_and_no_real_time(name: str) -> None:
    """A virtual clock ends at the record's length over the speed, to the sound's way to the bob."""
    clock = VirtualClock()
    with SOURCES[name](clock) as source:
        for _ in source:
            pass
    assert clock.now_ns() == pytest.approx((SECONDS - 1 / RATE_HZ) / PACE.get(name, 1.0) * 1e9, abs=2e5)


@every_source
def test_leaving_ends_the_iteration(name: str) -> None:
    """After the ``with``, nothing is delivered any more; leaving twice does no harm."""
    source = SOURCES[name](VirtualClock())
    with source:
        blocks = iter(source)
        next(blocks)
    assert list(blocks) == []
    source.__exit__(None, None, None)
