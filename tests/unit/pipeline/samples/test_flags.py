"""Samples that a fit may not use are flagged; nothing is dropped, and nothing else is flagged."""

import numpy as np
import pytest

from pipeline.analyse import analyse
from pipeline.track import F8, Quality, Track
from tests.synthetic import Truth, noisy, times


def swing() -> tuple[F8, F8]:
    """Return times and distances of a bob."""
    t = times(10.0)
    return t, noisy(Truth(), t, 1e-4, 1)


def flagged(t: F8, y: F8, bit: Quality) -> list[int]:
    """Return the rows that carry a flag after the analysis."""
    found = analyse(Track.from_arrays(t, y)).flags
    assert found.size == t.size
    rows: list[int] = np.flatnonzero(found & np.uint8(bit)).tolist()
    return rows


def test_times_that_repeat_or_run_back_are_flagged() -> None:
    """A repeated time is a duplicate, one behind the latest is not monotonic, and so is one that is no number."""
    t, y = swing()
    t[10] = t[9]
    t[20] = t[18]
    t[30] = np.nan
    t[40] = t[45]  # a leap forward: rows 41 to 44 are then behind it, row 45 repeats it
    assert flagged(t, y, Quality.DUPLICATE_TIME) == [10, 45]
    assert flagged(t, y, Quality.NON_MONOTONIC_TIME) == [20, 30, 41, 42, 43, 44]


@pytest.mark.parametrize("height_m", [0.02, 2.0, -0.1])
@pytest.mark.parametrize("rows", [[0], [1], [400], [425], [500, 501], [998], [999]])
def test_false_echoes_are_flagged_and_hardly_a_neighbour(height_m: float, rows: list[int]) -> None:
    """One or two echoes from elsewhere are flagged wherever the bob is, with two neighbours at most."""
    t, y = swing()
    y[rows] += height_m
    found = flagged(t, y, Quality.FALSE_ECHO)
    assert set(rows) <= set(found)
    assert len(found) <= len(rows) + 2
