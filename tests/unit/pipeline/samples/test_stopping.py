"""Where a bob comes to rest is the same in every unit, and a bob that moves to the end has no such place."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.samples.condition import Conditioned, condition
from pipeline.samples.stopping import moving_part, stop_row
from pipeline.track import F8, Track

T: F8 = np.arange(6000) / 100.0


def samples(x: F8, sigma_m: float = 3e-4) -> Conditioned:
    """Return displacements with white noise, conditioned."""
    return condition(Track.from_arrays(T, 0.3 + x + sigma_m * np.random.default_rng(2).standard_normal(T.size)))


def stopping(stop_s: float) -> F8:
    """Return the displacement of a bob that friction stops at a time."""
    return 0.05 * np.maximum(1.0 - T / stop_s, 0.0) * np.cos(8.3 * T)


@pytest.mark.parametrize("stop_s", [10.0, 30.0, 50.0])
def test_a_stop_is_where_the_motion_ends(stop_s: float) -> None:
    """The row is that of the time at which the amplitude falls below the noise, within two blocks of samples."""
    row = stop_row(samples(stopping(stop_s)))
    assert row is not None
    assert 0.93 * stop_s - 0.5 < T[row] < stop_s + 0.5


@pytest.mark.parametrize("x", [0.05 * np.exp(-0.01 * T) * np.cos(8.3 * T), np.zeros(T.size)], ids=["moves", "never"])
def test_a_bob_that_moves_to_the_end_or_never_has_no_stop(x: F8) -> None:
    """Neither free motion to the last sample nor noise alone has a row at which it stops."""
    assert stop_row(samples(x)) is None
    assert moving_part(samples(x), 1.0) is None


def test_a_motion_without_noise_has_no_stop() -> None:
    """Where nothing says how large the noise is, nothing says what counts as rest."""
    assert stop_row(samples(np.zeros(T.size), 0.0)) is None


def test_the_moving_part_ends_at_the_stop() -> None:
    """It has the samples up to the stop, and there is none where the bob moves for more than the share asked for."""
    whole = samples(stopping(20.0))
    part = moving_part(whole, 0.75)
    assert part is not None
    assert len(part.track) == part.flags.size == stop_row(whole)
    np.testing.assert_array_equal(part.track.y, whole.track.y[: len(part.track)])
    assert moving_part(whole, 0.25) is None


@pytest.mark.parametrize("step", [0.001, 1.0, 1e-3 * math.pi / 180.0, 0.0254 / 72.0])
def test_where_a_bob_stops_is_the_same_in_every_unit(step: float) -> None:
    """A motion of two whole steps of the sensor is at the threshold, however the steps round when written in a unit."""
    t = np.arange(1200) / 20.0
    steps = np.where(t < 20.0, 3.0, np.where(t < 25.0, 2.0, 0.0))
    counts = 500.0 + np.round(steps * np.sign(np.sin(2.0 * math.pi * t)))
    found = moving_part(condition(Track.from_arrays(t, counts * step, quantum_m=step)), 0.75)
    assert found is not None
    assert 20.0 <= found.track.t[-1] <= 24.0
