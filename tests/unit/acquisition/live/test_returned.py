"""A port that came back: the host's clock gives the time across the gap where the device's does not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from acquisition.block import Block, Flag, concatenate
from acquisition.decoders.registry import get_family
from acquisition.live.decoding import SensorChain
from acquisition.readings import Reading, Readings

STEP_S = 0.01
WRAP_US = 1 << 32


def chain() -> SensorChain:
    """Return a chain of the line protocol whose decoder takes readings as they are."""
    return SensorChain(get_family("line-protocol"), rate_hz=100.0)


def readings(
    true_s: np.ndarray, clock_s: np.ndarray, rng: np.random.Generator, *, late_s: float = 0.005
) -> list[Reading]:
    """Return readings without echoes of devices whose clock shows ``clock_s``; their stamps are late at random."""
    late = rng.exponential(late_s, true_s.size)
    late[:: max(1, true_s.size // 10)] *= 0.1
    stamps = np.maximum.accumulate(true_s + late)
    columns = zip((stamps * 1e9).astype(int), np.arange(true_s.size), np.rint(clock_s * 1e6).astype(int), strict=True)
    return [Reading(int(ns), int(n), int(us) % WRAP_US, distance_m=0.5) for ns, n, us in columns]


def taken(each: SensorChain, parts: Sequence[list[Reading]], at_once: int) -> Block:
    """Return the samples of stretches between which the port was away, asked for after every so many readings."""
    blocks = []
    for number, part in enumerate(parts):
        if number:
            each.lost()
            each.returned()
        for start in range(0, len(part), at_once):
            each._held += Readings(part[start : start + at_once])
            blocks.append(each.block())
    return concatenate([*blocks, each.block(final=True)])


@pytest.mark.parametrize("leap_s", [0.0, -1e9, 2990.0, 30.0, 1.0, 0.05, -0.05, -3.0])
@pytest.mark.parametrize("ppm", [0.0, 4000.0])
def test_the_time_behind_a_gap_is_right_whatever_the_counter_shows(leap_s: float, ppm: float) -> None:
    """To ten milliseconds, behind 0.5 and 20 s, for a crystal and for a resonator whose rate is known by then."""
    for seed, gap_s in enumerate((0.5, 20.0)):
        rng = np.random.default_rng([seed, abs(int(leap_s))])
        first = np.arange(2000) * STEP_S
        second = first[-1] + gap_s + np.arange(500) * STEP_S
        pace = 1.0 + 1e-6 * ppm
        clock = 100.0 + pace * first, (100.0 + pace * second + leap_s if leap_s > -1e9 else pace * (second - second[0]))
        parts = [readings(first, clock[0], rng), readings(second, clock[1], rng)]
        each = chain()
        block = taken(each, parts, 2500)
        assert np.abs(block.t - pace * np.concatenate([first, second])).max() < 0.01
        assert bool(each.timebase.joins) == (leap_s != 0.0)
        assert np.flatnonzero(block.flags & Flag.GAP_BEFORE).tolist() == [2000]
        (gap,) = each.timebase.gaps
        assert gap.lost == (0 if leap_s else round(gap_s / STEP_S * pace) - 1)
        # However often samples were asked for, the bits are the same.
        assert taken(chain(), parts, 7).t.tobytes() == block.t.tobytes()


def test_a_counter_that_wraps_while_the_port_is_away_goes_on() -> None:
    """The device's own step stands, to the microsecond."""
    rng = np.random.default_rng(2)
    first, second = np.arange(500) * STEP_S, 7.0 + np.arange(500) * STEP_S
    before_s = WRAP_US * 1e-6 - 5.5
    each = chain()
    block = taken(each, [readings(first, before_s + first, rng), readings(second, before_s + second, rng)], 10)
    assert each.timebase.joins == 0
    np.testing.assert_allclose(block.t, np.concatenate([first, second]), atol=2e-6)


def test_a_burst_behind_a_gap_does_not_move_the_time() -> None:
    """If a link delays half a second of readings and delivers them together, the device's time is kept."""
    rng = np.random.default_rng(3)
    first, second = np.arange(500) * STEP_S, 7.0 + np.arange(300) * STEP_S
    late = [each._replace(host_ns=max(each.host_ns, 7_600_000_000)) for each in readings(second, second, rng)]
    each = chain()
    block = taken(each, [readings(first, first, rng), late], 10)
    assert each.timebase.joins == 0
    np.testing.assert_allclose(block.t, np.concatenate([first, second]), atol=2e-6)


def test_what_comes_back_for_less_than_a_second_is_timed_too() -> None:
    """Thrice for a moment, each with another counter, and at the end of the run for three readings."""
    rng = np.random.default_rng(4)
    starts, counts = (0.0, 6.0, 7.0, 8.0), (500, 20, 20, 3)
    true = [start + np.arange(count) * STEP_S for start, count in zip(starts, counts, strict=True)]
    parts = [readings(t, t - t[0] + 50.0 * n, rng, late_s=0.002) for n, t in enumerate(true)]
    each = chain()
    block = taken(each, parts, 3)
    assert np.abs(block.t - np.concatenate(true)).max() < 0.01
    assert each.timebase.joins == 3
