"""A track is made of anything array-like, or refused in one line."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.errors import PipelineError, TrackError
from pipeline.track import Track

RISING = {"t": [0.0, 1.0], "y": [0.0, 1.0]}


@pytest.mark.parametrize(
    "arguments",
    [
        {"t": [0.0, 1.0], "y": [0.0]},
        {"t": [[0.0, 1.0]], "y": [[0.0, 1.0]]},
        {"t": 0.0, "y": 0.0},
        {"t": [], "y": []},
        {**RISING, "flags": [0]},
        {"t": [1.0, 0.0], "y": [0.0, 1.0]},
        {"t": [np.nan, np.nan], "y": [0.0, 1.0]},
        *({**RISING, name: x} for name in ("sigma_m", "quantum_m", "rate_hz") for x in (0.0, -1e-3, np.nan, np.inf)),
    ],
)
def test_what_makes_no_track_is_refused_in_one_line(arguments: dict[str, Any]) -> None:
    """Shapes that differ, too few samples, times that never increase, a noise, a step or a rate that cannot be."""
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
