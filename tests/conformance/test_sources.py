"""The rules that a replay keeps at every speed."""

import math

import numpy as np
import pytest

from acquisition.block import Block, Flag, SourceInfo, concatenate
from acquisition.clock import Clock, VirtualClock
from acquisition.replay import Replay

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


def replay(clock: Clock, speed: float | None) -> Replay:
    """Return a replay of it at a speed."""
    return Replay(run(), clock, info=SourceInfo("replay", "run", RATE_HZ, quantum_m=1e-5), speed=speed)


every_speed = pytest.mark.parametrize("speed", [1.0, 10.0, None])


@every_speed
def test_samples_are_those_of_the_run_bit_for_bit(speed: float | None) -> None:
    """Whatever the pace, the samples are the same, and each block begins where the one before ended."""
    with replay(VirtualClock(), speed) as source:
        blocks = list(source)
    assert [block.first for block in blocks] == [0, *np.cumsum([len(block) for block in blocks])[:-1].tolist()]
    joined = concatenate(blocks)
    for column in ("t", "distance", "flags", "velocity"):
        assert getattr(joined, column).tobytes() == getattr(run(), column).tobytes()
    assert joined.host_ns is None


@every_speed
def test_it_takes_the_clock_time_of_its_pace_and_no_real_time(speed: float | None) -> None:
    """A virtual clock ends at the record's length over the speed."""
    clock = VirtualClock()
    with replay(clock, speed) as source:
        assert sum(map(len, source)) == len(run())
    assert clock.now_ns() == pytest.approx((SECONDS - 1 / RATE_HZ) / (speed or math.inf) * 1e9, abs=2e5)


@every_speed
def test_leaving_ends_the_iteration(speed: float | None) -> None:
    """After the ``with``, nothing is delivered any more; leaving twice does no harm."""
    source = replay(VirtualClock(), speed)
    with source:
        blocks = iter(source)
        next(blocks)
    assert list(blocks) == []
    source.__exit__(None, None, None)
