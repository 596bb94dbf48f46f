"""The moment at which a recording starts by itself."""

from __future__ import annotations

import math

import numpy as np
import pytest

from acquisition.block import Block
from springmass.session.trigger import Trigger, Watch


def block(*distance_m: float) -> Block:
    """Return samples with these distances, 10 ms apart."""
    n = len(distance_m)
    host_ns = np.arange(n, dtype=np.int64) * 10
    return Block(0, np.arange(n) / 100, np.array(distance_m), np.zeros(n, np.uint8), host_ns)


@pytest.mark.parametrize("rest_m", [0.25, math.nan])
def test_the_first_sample_off_its_place_gives_the_moment(rest_m: float) -> None:
    """Measured from the rest position, or from the first distance; missing samples are no motion."""
    watch = Watch(Trigger(0.01), rest_m)
    assert watch.moment_ns(block(math.nan, math.nan)) is None
    assert watch.moment_ns(block(math.nan, 0.25, 0.259)) is None
    assert watch.moment_ns(block(0.25, math.nan, 0.239, 0.25)) == 20


def test_the_place_is_the_first_distance_that_came() -> None:
    """A later block is measured from the first one."""
    watch = Watch(Trigger(0.01))
    assert watch.moment_ns(block(0.30)) is None
    assert watch.moment_ns(block(0.25)) == 0
