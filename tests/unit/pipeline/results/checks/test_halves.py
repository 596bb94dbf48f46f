"""Whether the halves of a record say the same of its model is checked, and said."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.accuracy import params_for
from pipeline.analyse import analyse
from pipeline.track import F8, Track

T: F8 = np.arange(3000) / 100.0


def told(seed: int, depth: float, tier: str = "standard") -> list[str]:
    """Return what is said of the halves of a record whose phase swings to and fro once by some radians."""
    angle = 8.3 * T + depth * np.sin(2.0 * np.pi * T / 25.0)
    y = 0.3 + 0.05 * np.exp(-0.012 * T) * np.cos(angle)
    track = Track.from_arrays(T, y + 3e-4 * np.random.default_rng(seed).standard_normal(T.size))
    found = analyse(track, params=params_for(tier))
    return [one.message for one in found.findings if one.code == "halves_differ"]


@pytest.mark.parametrize("seed", range(3))
def test_halves_that_differ_are_told(seed: int) -> None:
    """A phase that no model of the windows follows leaves halves that differ, and the way to a better fit is named."""
    (message,) = told(seed, 0.06)
    assert "--accuracy best" in message
    assert all("--accuracy best" not in one for one in told(seed, 0.06, "best"))


def test_noise_alone_is_no_difference() -> None:
    """Of forty plain records at most one has halves that differ by four standard uncertainties."""
    assert sum(bool(told(seed, 0.0)) for seed in range(40)) <= 1
