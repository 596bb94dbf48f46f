"""A track is made of anything array-like, or refused in one line."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.block import UNITS as BLOCK_UNITS
from acquisition.block import Flag
from pipeline.errors import PipelineError, TrackError
from pipeline.track import UNITS, UNUSABLE, Quality, Track


def test_quality_is_the_run_files_flags() -> None:
    """The pipeline's bits and the acquisition's are one table, but for one that no file holds."""
    assert {bit.name: bit.value for bit in Quality if bit is not Quality.OUTSIDE} == {
        bit.name: bit.value for bit in Flag
    }
    assert int(Quality.OUTSIDE) not in {bit.value for bit in Flag}


def test_only_a_gap_before_leaves_a_sample_usable() -> None:
    """Every bit but GAP_BEFORE keeps a sample out of fits."""
    assert [bit for bit in Quality if not int(UNUSABLE) & bit] == [Quality.GAP_BEFORE]


def test_lists_become_float_arrays() -> None:
    """Lists of whole numbers become float64 seconds and metres, flags become bytes."""
    track = Track.from_arrays([0, 1, 2], [1, 2, 3], flags=[0, 1, 64])
    assert (track.t.dtype, track.y.dtype, track.flags.dtype) == (np.float64, np.float64, np.uint8)
    assert len(track) == 3
    assert track.rate_hz == 1.0
    assert (track.clock, track.kind) == ("nominal", "replay")


def test_arrays_are_copied() -> None:
    """What happens to the caller's array afterwards does not reach the track."""
    y = np.array([0.1, 0.2, 0.3])
    track = Track.from_arrays([0.0, 0.01, 0.02], y)
    y[:] = 9.0
    assert track.y.tolist() == [0.1, 0.2, 0.3]


@pytest.mark.parametrize("rate", [99.9, 0.1])
def test_rate_is_the_reciprocal_of_the_median_step(rate: float) -> None:
    """The rate is told from times even where one of them is missing, repeated or late."""
    t = np.arange(101) / rate
    t[20], t[30], t[40] = np.nan, t[29], t[40] + 0.4 / rate
    assert Track.from_arrays(t, np.zeros(101)).rate_hz == pytest.approx(rate, rel=1e-6)


@pytest.mark.parametrize(
    "arguments",
    [
        {"t": [0.0, 1.0], "y": [0.0]},
        {"t": [[0.0, 1.0]], "y": [[0.0, 1.0]]},
        {"t": 0.0, "y": 0.0},
        {"t": [], "y": []},
        {"t": [0.0, 1.0], "y": [0.0, 1.0], "flags": [0]},
        {"t": [1.0, 0.0], "y": [0.0, 1.0]},
        {"t": [np.nan, np.nan], "y": [0.0, 1.0]},
        {"t": [0.0, 1.0], "y": [0.0, 1.0], "rate_hz": 0.0},
        {"t": [0.0, 1.0], "y": [0.0, 1.0], "rate_hz": np.inf},
    ],
)
def test_arrays_that_make_no_track_are_refused_in_one_line(arguments: dict[str, Any]) -> None:
    """Shapes that differ, too few samples, times that never increase and impossible rates."""
    with pytest.raises(TrackError) as raised:
        Track.from_arrays(**arguments)
    assert "\n" not in str(raised.value)


ANY_FLOATS = st.lists(st.floats(width=64), max_size=12)


@given(ANY_FLOATS, ANY_FLOATS, st.one_of(st.none(), st.floats()))
def test_any_numbers_make_a_track_or_a_track_error(t: list[float], y: list[float], rate: float | None) -> None:
    """Whatever the numbers, there is a track of them, infinite times as unknown, or a PipelineError; no warning."""
    try:
        track = Track.from_arrays(t, y, rate_hz=rate)
    except PipelineError:
        return
    np.testing.assert_array_equal(track.t, np.where(np.isfinite(t), t, np.nan))
    np.testing.assert_array_equal(track.y, y)
    assert track.rate_hz > 0
    assert np.isfinite(track.rate_hz)


def test_units_are_those_of_blocks() -> None:
    """The pipeline's quantities and the acquisition's are one table."""
    assert UNITS == BLOCK_UNITS


@pytest.mark.parametrize(("quantity", "unit"), [("length", "cm"), ("angle", "m"), ("angle", "deg"), ("colour", "m")])
def test_an_unknown_quantity_or_unit_is_refused(quantity: str, unit: str) -> None:
    """Only the SI unit of a quantity that is known."""
    with pytest.raises(TrackError, match=f"got {quantity} in {unit}"):
        Track.from_arrays([0.0, 1.0], [0.0, 1.0], quantity=quantity, unit=unit)
