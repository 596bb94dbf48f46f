"""What a recording did not get, from its samples and events."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.block import Block, Flag
from storage.recovery.losses import Event, LossCount, Losses, end_of

SECOND_NS = 1_000_000_000


def count_of(missing: np.ndarray, pieces: int = 1) -> LossCount:
    """Return the count of readings at 100 Hz, given in so many blocks."""
    n = missing.size
    t = np.arange(n) / 100
    flags = np.where(missing, np.uint8(Flag.MISSING), np.uint8(0)).astype(np.uint8)
    samples = Block(0, t, np.where(missing, np.nan, 0.3), flags, (t * 1e9).astype(np.int64))
    count = LossCount(100.0)
    for cut in np.array_split(np.arange(n), pieces):
        count.push(samples[int(cut[0]) : int(cut[-1]) + 1])
    return count


def codes(losses: Losses) -> list[str]:
    """Return the codes of what an analysis says."""
    return [trap.code for trap in losses.traps()]


@pytest.mark.parametrize("pieces", [1, 2, 7, 400])
def test_a_lost_target_is_measured_in_all_and_at_a_stretch(pieces: int) -> None:
    """Whatever blocks the samples come in; at the beginning, within, and up to the end."""
    missing = np.zeros(1000, bool)
    missing[:50] = missing[300:500] = missing[900:] = True
    result = count_of(missing, pieces).losses([], 0, 10 * SECOND_NS)
    assert result.no_target_s == pytest.approx(3.5, abs=0.05)
    assert result.longest_no_target_s == pytest.approx(2.0, abs=0.02)
    assert codes(result) == ["no_target"]


def test_a_run_without_loss_says_nothing() -> None:
    """A sensor that was there to the end, with a ping without echo now and then."""
    result = count_of(np.arange(1000) % 5 != 0).losses([], 0, 10 * SECOND_NS)
    assert (result.gone_s, result.away) == (None, ())
    assert codes(result) == []


def test_a_sensor_that_is_silent_at_the_end_is_gone() -> None:
    """From a second and a half on, without a word of its port."""
    count = count_of(np.zeros(1000, bool))
    assert count.losses([], 0, 11 * SECOND_NS).gone_s is None
    result = count.losses([], 0, 20 * SECOND_NS)
    assert result.gone_s == pytest.approx(10.01, abs=0.01)
    assert codes(result) == ["sensor_lost"]


def test_ports_that_went_and_came_are_told_with_their_times() -> None:
    """Lost twice, another device refused once, then lost until the end."""
    events: list[Event] = [
        (1, {"kind": "lost", "facts": {"why": "cable"}}),
        (2, {"kind": "refused", "facts": {}}),
        (3, {"kind": "reopened", "facts": {"gap_s": 1.5}}),
        (4, {"kind": "lost", "facts": {}}),
        (5, {"kind": "reopened", "facts": {"gap_s": 0.5}}),
        (6, {"kind": "overflow", "facts": {"records": 7, "bytes": 70}}),
        (7, {"kind": "lost", "facts": {"why": "the plug"}}),
    ]
    result = count_of(np.zeros(1000, bool)).losses(events, 0, 10 * SECOND_NS)
    assert result.away == (1.5, 0.5)
    assert (result.why, result.refused, result.dropped_reads, result.dropped_bytes) == ("the plug", 1, 7, 70)
    assert codes(result) == ["sensor_lost", "sensor_away", "other_device", "readings_dropped"]


def test_the_end_is_the_one_noted_or_the_last_that_came() -> None:
    """A disk that took the end record late does not make a sensor gone."""
    ended: Event = (5, {"kind": "ended", "facts": {}})
    assert end_of([(9, {"kind": "lost"}), ended], [3, None], 0) == 5
    assert end_of([(9, {"kind": "lost"})], [3, None], 0) == 9
    assert end_of([], [3, None], 0) == 3
