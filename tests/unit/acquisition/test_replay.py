"""Replay: pace, pause, step, seek and loop, all without waiting."""

from __future__ import annotations

import math
import threading
from itertools import islice

import numpy as np
import pytest

from acquisition.block import Block, Flag, concatenate
from acquisition.clock import SystemClock, VirtualClock
from acquisition.replay import Replay
from acquisition.source import SourceInfo

INFO = SourceInfo("replay", "run", 100.0)


def run(count: int = 100) -> Block:
    """Return a run at 100 Hz."""
    t = np.arange(count) / 100
    return Block(0, t, 0.2 + 0.01 * np.sin(8 * t), np.zeros(count, np.uint8), None, np.cos(8 * t))


def test_blocks_are_due_with_their_last_sample() -> None:
    """At twice the speed a second takes half of one, on absolute deadlines."""
    clock = VirtualClock(7)
    replay = Replay([run()], clock, info=INFO, speed=2.0, block_samples=25)
    seen = [(block.first, clock.now_ns() - 7) for block in replay]
    assert seen == [(0, 120_000_000), (25, 245_000_000), (50, 370_000_000), (75, 495_000_000)]


@pytest.mark.parametrize("speed", [None, math.inf])
def test_as_fast_as_possible_never_sleeps(speed: float | None) -> None:
    """Nothing is asked of the clock but its time."""
    clock = VirtualClock()
    assert len(concatenate(Replay([run()], clock, info=INFO, speed=speed))) == 100
    assert clock.now_ns() == 0


def test_a_slow_consumer_is_not_given_a_drift() -> None:
    """Deadlines are absolute: time lost in the consumer is caught up."""
    clock = VirtualClock()
    for block in Replay([run()], clock, info=INFO, block_samples=10):
        clock.sleep_until_ns(clock.now_ns() + (300_000_000 if block.first == 0 else 0))
    assert clock.now_ns() == 990_000_000


def test_play_begins_when_iteration_does() -> None:
    """Time between making a replay and playing it is not caught up."""
    clock = VirtualClock()
    replay = Replay([run(20)], clock, info=INFO, speed=0.5, block_samples=10)
    replay.seek(0.1)
    clock.sleep_until_ns(10**12)
    (block,) = replay
    assert clock.now_ns() == 10**12 + 180_000_000
    assert (block.t[0], replay.segment, block.flags.any()) == (0.1, 0, False)


def test_seek_begins_a_segment() -> None:
    """Record time jumps, the index goes on, and the first sample carries a gap."""
    whole = run()
    replay = Replay([whole], VirtualClock(), info=INFO, block_samples=20)
    blocks = iter(replay)
    next(blocks)
    replay.seek(0.5)
    assert replay.segment == 0
    block = next(blocks)
    assert (block.first, block.t[0], replay.segment) == (20, 0.5, 1)
    assert block.flags.tolist() == [Flag.GAP_BEFORE] + [0] * 19
    assert not whole.flags.any()
    replay.seek(-3.0)
    assert next(blocks).t[0] == 0.0
    replay.seek(99.0)
    assert list(blocks) == []


def test_seek_takes_a_new_reference() -> None:
    """After a jump the pace is that of the record from there."""
    clock = VirtualClock()
    replay = Replay([run()], clock, info=INFO, block_samples=10)
    blocks = iter(replay)
    next(blocks)
    replay.seek(0.9)
    next(blocks)
    assert clock.now_ns() == 90_000_000 + 90_000_000


def test_a_loop_starts_a_new_segment_each_turn() -> None:
    """Record time restarts, the index goes on, the pace holds, and nothing wraps in silence."""
    clock = VirtualClock()
    whole = run(30)
    replay = Replay([whole], clock, info=INFO, block_samples=30, loop=True)
    turns = [(block, replay.segment, clock.now_ns()) for block, _ in zip(replay, range(3), strict=False)]
    assert [(block.first, segment) for block, segment, _ in turns] == [(0, 0), (30, 1), (60, 2)]
    assert [now_ns for *_, now_ns in turns] == [290_000_000, 590_000_000, 890_000_000]
    for block, segment, _ in turns:
        np.testing.assert_array_equal(block.t, whole.t)
        np.testing.assert_array_equal(block.distance, whole.distance)
        assert block.flags[0] == (Flag.GAP_BEFORE if segment else 0)
        assert not block.flags[1:].any()


def test_a_loop_as_fast_as_possible_goes_on() -> None:
    """Without a pace the turns follow each other."""
    replay = Replay([run(30)], VirtualClock(), info=INFO, speed=None, block_samples=30, loop=True)
    assert [block.first for block, _ in zip(replay, range(4), strict=False)] == [0, 30, 60, 90]


def test_paused_play_steps_and_resumes_without_catching_up() -> None:
    """Stepping delivers samples immediately; resuming continues at the normal speed."""
    clock = VirtualClock()
    replay = Replay([run()], clock, info=INFO, block_samples=16)
    replay.pause()
    replay.step(20)
    blocks = iter(replay)
    assert [len(next(blocks)), len(next(blocks))] == [16, 4]
    assert clock.now_ns() == 0
    assert replay.paused
    assert replay.position_s == 0.19
    clock.sleep_until_ns(5_000_000_000)
    replay.resume()
    assert len(next(blocks)) == 16
    assert clock.now_ns() == 5_000_000_000 + 160_000_000


def test_a_paused_iterator_waits_for_another_thread() -> None:
    """It sleeps on a condition until resumed, and nothing is lost."""
    replay = Replay([run()], VirtualClock(), info=INFO)
    replay.pause()
    got: list[Block] = []
    player = threading.Thread(target=lambda: got.extend(replay), daemon=True)
    player.start()
    assert not got
    replay.resume()
    player.join(60)
    assert not player.is_alive()
    assert len(concatenate(got)) == 100


def test_close_ends_a_paused_iterator() -> None:
    """A consumer that waits is let go; closing again does no harm."""
    replay = Replay([run()], VirtualClock(), info=INFO)
    replay.pause()
    player = threading.Thread(target=lambda: list(replay), daemon=True)
    player.start()
    replay.close()
    replay.close()
    player.join(60)
    assert not player.is_alive()


def test_a_pause_interrupts_a_long_wait() -> None:
    """A block hours away does not keep a pause or a close from being heard."""
    replay = Replay([run()], SystemClock(), info=INFO, speed=1e-6)
    got: list[Block] = []
    player = threading.Thread(target=lambda: got.extend(islice(replay, 7)), daemon=True)
    player.start()
    replay.pause()
    replay.step(100)
    player.join(60)
    assert not player.is_alive()
    assert len(concatenate(got)) == 100


def test_controls_from_many_threads_lose_no_sample() -> None:
    """Pauses in any order change the pace, never the samples."""
    whole = run(2000)
    replay = Replay([whole], VirtualClock(), info=INFO, speed=3.0, block_samples=7)
    done = threading.Event()

    def fiddle() -> None:
        while not done.is_set():
            replay.pause()
            replay.resume()

    hands = [threading.Thread(target=fiddle, daemon=True) for _ in range(2)]
    for hand in hands:
        hand.start()
    joined = concatenate(replay)
    done.set()
    for hand in hands:
        hand.join(60)
    np.testing.assert_array_equal(joined.distance, whole.distance)
    np.testing.assert_array_equal(joined.flags, whole.flags)


def test_times_that_run_back_wait_for_nothing() -> None:
    """A faulty clock in the record delays no sample and drops none."""
    whole = run(6)
    whole.t[3] = 0.0
    clock = VirtualClock()
    joined = concatenate(Replay([whole], clock, info=INFO, block_samples=1))
    np.testing.assert_array_equal(joined.t, whole.t)
    assert clock.now_ns() == 50_000_000


def test_kind_travels_with_the_data() -> None:
    """Simulated data stay simulated; all else is a replay."""
    simulated = SourceInfo("simulated", "s", 100.0)
    assert Replay([run()], VirtualClock(), info=simulated).info.kind == "simulated"
    assert Replay([run()], VirtualClock(), info=SourceInfo("live", "p", 100.0)).info.kind == "replay"


def test_position() -> None:
    """Where play stands is told in record time."""
    clock = VirtualClock()
    replay = Replay([run()], clock, info=INFO, block_samples=10)
    assert replay.position_s == 0.0
    blocks = iter(replay)
    next(blocks)
    assert replay.position_s == pytest.approx(0.09)
    list(blocks)
    assert replay.position_s == 0.99


@pytest.mark.parametrize("speed", [0.0, -1.0, math.nan])
def test_a_speed_that_is_not_positive_is_refused(speed: float) -> None:
    """Time does not stand still or run back."""
    with pytest.raises(ValueError, match="speed must be positive"):
        Replay([run()], VirtualClock(), info=INFO, speed=speed)


def test_wrong_steps_seeks_and_sizes_are_refused() -> None:
    """Arguments that mean nothing are errors, not guesses."""
    replay = Replay([run()], VirtualClock(), info=INFO)
    with pytest.raises(ValueError, match="paused"):
        replay.step()
    with pytest.raises(ValueError, match="finite"):
        replay.seek(math.nan)
    with pytest.raises(ValueError, match="block_samples"):
        Replay([run()], VirtualClock(), info=INFO, block_samples=0)


def test_a_run_without_samples_plays_nothing() -> None:
    """A replay without blocks ends immediately, also in a loop."""
    with Replay([], VirtualClock(), info=INFO, loop=True) as replay:
        replay.seek(1.0)
        assert (list(replay), replay.position_s) == ([], 0.0)
