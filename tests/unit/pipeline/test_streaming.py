"""Live period and amplitude: the batch analysis of the samples held, at a memory that does not grow."""

from __future__ import annotations

import tracemalloc
from collections.abc import Iterable

import numpy as np
import pytest

from pipeline.analyse import analyse
from pipeline.streaming import LiveMotion, MotionAccumulator, NotYet
from pipeline.track import Quality, Track

RATE_HZ = 100.0


def motion(seconds: float, seed: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times, distances and flags of a damped swing with noise."""
    t = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    y = 0.25 + 0.05 * np.exp(-0.01 * t) * np.cos(8.3 * t + 0.4)
    return t, y + 1e-4 * np.random.default_rng(seed).standard_normal(t.size), np.zeros(t.size, np.uint8)


def push(held: MotionAccumulator, columns: Iterable[np.ndarray], sizes: Iterable[int]) -> None:
    """Push columns in parts of those sizes, then the rest."""
    t, y, flags = columns
    start = 0
    for size in [*sizes, t.size]:
        held.push(t[start : start + size], y[start : start + size], flags[start : start + size])
        start += size


def batch(t: np.ndarray, y: np.ndarray, flags: np.ndarray) -> LiveMotion:
    """Return what the batch analysis says of those samples."""
    found = analyse(Track(t, y, flags, RATE_HZ, clock="device")).estimates
    names = ("period", "amplitude", "offset", "noise")
    return LiveMotion(*(found[name] for name in names), float(t[-1] - t[0]))


@pytest.mark.parametrize("size", [1, 999, 1001, 2500])
def test_value_is_the_batch_analysis_of_the_same_samples(size: int) -> None:
    """However they were cut into pushes, with samples missing, rows that never came, and false echoes: bit for bit."""
    t, y, flags = motion(25.6)
    missing = np.random.default_rng(4).random(t.size) < 0.05
    y[missing], flags[missing] = np.nan, Quality.MISSING
    y[2100:2106] += 0.005
    flags[2060] |= Quality.GAP_BEFORE
    columns = [np.delete(column, np.s_[2000:2060]) for column in (t, y, flags)]
    held = MotionAccumulator(RATE_HZ, 10.0)
    push(held, columns, [size] * (2500 // size))
    assert len(held) == 1000
    live = held.value()
    assert live == batch(*(column[-1000:] for column in columns))
    assert isinstance(live, LiveMotion)
    assert live.period.value == pytest.approx(2 * np.pi / 8.3, rel=1e-3)


def test_memory_is_flat_over_an_hour() -> None:
    """360,000 samples pushed allocate no more than the window holds, and leave the last window."""
    held = MotionAccumulator(RATE_HZ, 10.0)
    t, y, flags = motion(60.0)
    tracemalloc.start()
    for minute in range(60):
        for start in range(0, 6000, 500):
            rows = slice(start, start + 500)
            held.push(60.0 * minute + t[rows], y[rows], flags[rows])
    grown, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert grown < 1_000_000  # all samples are 6 MB
    np.testing.assert_array_equal(held.track().t, 60.0 * 59 + t[-1000:])
    np.testing.assert_array_equal(held.track().y, y[-1000:])


NOTHING = np.full(1000, np.nan)
QUIET = 0.25 + 1e-4 * np.random.default_rng(5).standard_normal(1000)


NOT_YET = {
    "fifteen": NOTHING[:15],
    "none": NOTHING[:0],
    "all-missing": NOTHING,
    "still": QUIET,
    "constant": np.full(1000, 0.25),
    "ramp": np.linspace(0.2, 0.4, 1000),
    "one": np.where(np.arange(1000) == 500, 0.3, np.nan),
    "step": np.where(np.arange(1000) < 990, 0.25, 0.3),
}


@pytest.mark.parametrize("name", NOT_YET)
def test_it_says_why_there_is_no_value_yet(name: str) -> None:
    """Too few samples, no target or a bob at rest give one sentence, no exception and no number."""
    held, y = MotionAccumulator(RATE_HZ), NOT_YET[name]
    held.push(np.arange(y.size) / RATE_HZ, y, np.where(np.isnan(y), Quality.MISSING, 0).astype(np.uint8))
    answer = held.value()
    assert isinstance(answer, NotYet)
    assert answer.why
    assert "\n" not in answer.why
