"""Blocks, and their replay at its pace, from any second and in a loop, all without waiting."""

import numpy as np
import pytest

from acquisition.block import Block, Flag, SourceInfo, concatenate
from acquisition.clock import VirtualClock
from acquisition.replay import Replay

INFO = SourceInfo("replay", "run", 100.0)


def run(count: int = 100) -> Block:
    """Return a run at 100 Hz."""
    t = np.arange(count) / 100
    return Block(0, t, 0.2 + 0.01 * np.sin(8 * t), np.zeros(count, np.uint8), None, np.cos(8 * t))


def test_it_begins_at_a_time_of_the_recording() -> None:
    """At once and without a gap; behind the end there is nothing."""
    block = next(iter(Replay(run(), clock := VirtualClock(), info=INFO, from_s=0.5)))
    assert (block.first, block.t[0], clock.now_ns(), block.flags.any()) == (0, 0.5, 150_000_000, False)
    assert list(Replay(run(), VirtualClock(), info=INFO, from_s=99.0)) == []


def test_a_loop_has_a_gap_before_each_further_turn() -> None:
    """Record time restarts, the index goes on, the pace holds, and nothing wraps in silence."""
    clock = VirtualClock()
    whole = run(16)
    replay = Replay(whole, clock, info=INFO, loop=True)
    turns = [(block, clock.now_ns()) for block, _ in zip(replay, range(3), strict=False)]
    assert [(block.first, now_ns) for block, now_ns in turns] == [
        (0, 150_000_000),
        (16, 310_000_000),
        (32, 470_000_000),
    ]
    for block, _ in turns:
        np.testing.assert_array_equal(block.t, whole.t)
        np.testing.assert_array_equal(block.distance, whole.distance)
        assert block.flags[0] == (Flag.GAP_BEFORE if block.first else 0)
        assert not block.flags[1:].any()


def test_slices_and_joins_keep_the_quantity_and_two_are_not_joined() -> None:
    """Volts stay volts, and do not follow metres."""
    volts = Block(0, np.zeros(4), np.zeros(4), np.zeros(4, np.uint8), quantity="voltage", unit="V")
    joined = concatenate([volts[:1], volts[1:]])
    assert (joined.quantity, joined.unit) == ("voltage", "V")
    with pytest.raises(ValueError, match="one quantity, got length, voltage"):
        concatenate([volts, Block(4, np.zeros(1), np.zeros(1), np.zeros(1, np.uint8))])
