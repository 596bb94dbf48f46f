"""What holds nothing but a bob at rest is left out: before the trigger, and long after the stop."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.samples.condition import Conditioned, condition
from pipeline.track import F8, Track
from pipeline.windows.part import before_release, before_trigger, long_after_stop

T: F8 = np.arange(6000) / 100.0


def samples(x: F8, trigger_s: float | None = None) -> Conditioned:
    """Return displacements with white noise, conditioned, of a recording with a trigger or none."""
    track = Track.from_arrays(T, 0.3 + x + 3e-4 * np.random.default_rng(2).standard_normal(T.size))
    return condition(replace(track, trigger_s=trigger_s))


def released(at_s: float) -> F8:
    """Return the displacement of a bob that hangs still until its release."""
    return np.where(at_s > T, 0.0, 0.05 * np.cos(8.3 * (T - at_s)))


def test_a_still_start_ends_at_the_trigger() -> None:
    """A bob that hangs still until the trigger is analysed from there to the end."""
    part = before_trigger(samples(released(5.0), 5.0))
    assert part is not None
    assert (part.first_s, part.last_s) == (5.0, math.inf)
    (span,) = part.left_out
    assert (span.kind, span.first_s, span.last_s) == ("waiting", 0.0, 5.0)


@pytest.mark.parametrize("trigger_s", [None, 20.0, 59.8, 0.0])
def test_a_trigger_that_parts_nothing_leaves_nothing_out(trigger_s: float | None) -> None:
    """No trigger, one in a swing, one with too little after it, or one before the first sample."""
    assert before_trigger(samples(released(0.0), trigger_s)) is None


def test_twice_the_time_of_the_motion_is_kept() -> None:
    """Of a minute in which the bob moves for five seconds about ten are kept: they show the rest position."""
    x = 0.05 * np.maximum(1.0 - T / 5.0, 0.0) * np.cos(8.3 * T)
    part = long_after_stop(samples(x), 0.25)
    assert part is not None
    assert part.first_s == -math.inf
    assert part.last_s == pytest.approx(10.0, rel=0.15)
    (span,) = part.left_out
    assert (span.kind, span.first_s, span.last_s) == ("at_rest", part.last_s, T[-1])


def test_a_stop_in_the_second_quarter_leaves_nothing_out() -> None:
    """A bob that moves for a third of the recording shows its motion in the spectrum well enough."""
    x = 0.05 * np.maximum(1.0 - T / 20.0, 0.0) * np.cos(8.3 * T)
    assert long_after_stop(samples(x), 0.25) is None


def test_what_comes_before_a_release_is_left_out() -> None:
    """A bob that hangs, is lifted, held for four seconds and released is analysed from its release on."""
    omega = 2.0 * np.pi / 0.8
    hand = 0.05 * np.clip((T - 2.0) / 0.7, 0.0, 1.0)
    x = np.where(T < 7.0, hand, 0.05 * np.exp(-0.02 * (T - 7.0)) * np.cos(omega * (T - 7.0)))
    part = before_release(samples(x), periods=0.75)
    assert part is not None
    assert part.first_s == pytest.approx(7.1, abs=0.08)
    (span,) = part.left_out
    assert span.kind == "at_rest"


@pytest.mark.parametrize("rate", [0.02, 0.5])
def test_a_bob_that_swings_from_the_start_has_no_release(rate: float) -> None:
    """However fast it comes to rest: the stillness comes after the motion."""
    x = 0.05 * np.exp(-rate * T) * np.cos(2.0 * np.pi * T / 0.8)
    assert before_release(samples(x), periods=0.75) is None
