"""What a recording shows of itself."""

from __future__ import annotations

import numpy as np

from acquisition.block import Block, Flag
from pipeline.streaming import LiveMotion, NotYet
from springmass.session.display.progress import MOTION_EVERY_NS, SECOND_NS, LiveState


def block(first: int, n: int = 100) -> Block:
    """Return one second of a swing of 1.27 s."""
    t = (first + np.arange(n)) / 100
    flags = np.zeros(n, np.uint8)
    flags[0] = Flag.MISSING
    y = 0.25 + 0.05 * np.cos(4.95 * t) + 1e-4 * np.random.default_rng(first).standard_normal(n)
    return Block(first, t, np.where(flags == 0, y, np.nan), flags, (t * 1e9).astype(np.int64))


def test_samples_and_missing_ones_are_counted_over_all_sensors() -> None:
    """The rate is the first sensor's over the last second."""
    shown = LiveState(100.0)
    for second in range(4):
        shown.push([(0, block(100 * second)), (1, block(50 * second, 50))])
    assert (shown.samples, shown.missing) == (600, 8)
    assert shown.rate_hz(4 * SECOND_NS) == 100
    assert shown.rate_hz(6 * SECOND_NS) == 0
    assert shown.silent_s(6 * SECOND_NS) > 2.0


def test_the_motion_is_found_anew_every_other_second() -> None:
    """Before there is one at each asking; then the last one is given for two seconds."""
    shown = LiveState(100.0)
    assert isinstance(shown.motion(0), NotYet)
    for second in range(10):
        shown.push([(0, block(100 * second))])
    first = shown.motion(SECOND_NS)
    assert isinstance(first, LiveMotion)
    assert abs(first.period.value - 2 * np.pi / 4.95) < 1e-3
    shown.push([(0, block(1000))])
    assert shown.motion(2 * SECOND_NS) is first
    assert shown.motion(SECOND_NS + MOTION_EVERY_NS) is not first


def test_the_sensor_that_came_back_in_another_channel_is_shown_from_then_on() -> None:
    """Its motion begins anew, and what was wrong with the one before is said no longer."""
    shown = LiveState(100.0)
    for second in range(3):
        shown.push([(0, block(100 * second))])
    shown.follow(2)
    assert shown.latest()[0].size == 0
    assert isinstance(shown.motion(0), NotYet)
    for second in range(10):
        shown.push([(2, block(100 * second))])
        shown.follow(2)
    found = shown.motion(SECOND_NS)
    assert isinstance(found, LiveMotion)
    assert abs(found.period.value - 2 * np.pi / 4.95) < 1e-3
    assert list(shown.useful) == [2]
    assert shown.samples == 1300


def test_the_zero_of_the_run_is_the_earliest_stamp_of_a_sample_at_its_time() -> None:
    """A late stamp does not move it, nor do other sensors or samples after the first thousand."""
    shown = LiveState(100.0)
    assert shown.zero_ns is None
    late = block(0)
    assert late.host_ns is not None
    late.host_ns[:] += 5_000_000_000
    late.host_ns[:50] += 30_000_000
    shown.push([(0, late), (1, block(0))])
    assert shown.zero_ns == 5_000_000_000
    for second in range(1, 10):
        shown.push([(0, block(100 * second))])
    assert shown.zero_ns == 0
    early = block(1000)
    assert early.host_ns is not None
    early.host_ns[:] -= 1_000_000_000
    shown.push([(0, early)])
    assert shown.zero_ns == 0
