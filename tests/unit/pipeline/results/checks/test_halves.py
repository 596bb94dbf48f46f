"""Whether the halves of a record say the same of its model is checked, and said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.accuracy import params_for
from pipeline.analyse import Analysis, analyse
from pipeline.motion.waveform_fit import Params
from pipeline.track import F8, Track

T: F8 = np.arange(3000) / 100.0


def analysed(seed: int, depth: float, tier: str = "standard", *, whole: bool = False) -> Analysis:
    """Return the analysis of a record whose phase swings to and fro once by some radians."""
    angle = 8.3 * T + depth * np.sin(2.0 * np.pi * T / 25.0)
    y = 0.3 + 0.05 * np.exp(-0.012 * T) * np.cos(angle)
    track = Track.from_arrays(T, y + 3e-4 * np.random.default_rng(seed).standard_normal(T.size))
    params = params_for(tier)
    return analyse(track, params=replace(params, full=Params()) if whole else params)


def told(seed: int, depth: float, tier: str = "standard") -> list[str]:
    """Return what is said of the halves of such a record."""
    found = analysed(seed, depth, tier)
    return [one.message for one in found.findings if one.code == "halves_differ"]


@pytest.mark.parametrize("seed", range(3))
def test_halves_that_differ_are_told(seed: int) -> None:
    """A phase that no model of the windows follows leaves halves that differ, and the better fit is made at once."""
    (message,) = told(seed, 0.06)
    assert "the whole waveform was fitted too, as --accuracy best does" in message
    assert all("--accuracy best" not in one for one in told(seed, 0.06, "best"))


def test_uncertainties_hold_both_fits() -> None:
    """Where windows contradict themselves the fit of the waveform lies within two of their uncertainties."""
    windows, whole = analysed(1, 0.06, "standard").estimates, analysed(1, 0.06, "standard", whole=True).estimates
    for name in ("period", "amplitude", "phase", "damping_rate", "offset"):
        assert abs(windows[name].value - whole[name].value) <= 2.0 * windows[name].u, name


def test_fast_says_that_halves_differ_and_fits_no_waveform() -> None:
    """The fast tier keeps its time: it says what it found, and leaves the second fit to the others."""
    (message,) = told(1, 0.06, "fast")
    assert "whole waveform" not in message


def test_noise_alone_is_no_difference() -> None:
    """Of forty plain records at most one has halves that differ by four standard uncertainties."""
    assert sum(bool(told(seed, 0.0)) for seed in range(40)) <= 1
