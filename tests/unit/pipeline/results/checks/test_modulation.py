"""A second oscillation that beats slower than the record is named, and what it may add is in the uncertainties."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.analyse import Analysis, analyse
from pipeline.results.checks import modulation
from pipeline.track import F8, Track

OMEGA, AMPLITUDE, RATE = 8.3, 0.05, 0.012
T: F8 = np.arange(3000) / 100.0


def analysed(seed: int, second_m: float, ratio: float = 1.012, cubic: float = 0.0) -> Analysis:
    """Return the analysis of a bob with a second oscillation, and a frequency that falls with the square."""
    size = AMPLITUDE * np.exp(-RATE * T)
    bend = cubic * np.cumsum(size**2) / 100.0
    y = 0.3 + size * np.cos(OMEGA * T + bend) + second_m * np.cos(ratio * OMEGA * T + 2.1 * seed)
    return analyse(Track.from_arrays(T, y + 3e-4 * np.random.default_rng(seed).standard_normal(T.size)))


@pytest.mark.parametrize("seed", range(4))
def test_slow_beat_is_named_and_covered(seed: int) -> None:
    """Of 2 mm at 1.2 % above the bob's frequency the finding says the size, and amplitude and period are covered."""
    found = analysed(seed, 2e-3)
    (message,) = [one.message for one in found.findings if one.code == "amplitude_modulated"]
    size = float(message.split("the second of ")[1].split(" mm")[0])
    assert size == pytest.approx(2.0, rel=0.5)
    assert abs(found.estimates["amplitude"].value - AMPLITUDE) < 3.0 * found.estimates["amplitude"].u
    assert abs(found.estimates["period"].value - 2.0 * np.pi / OMEGA) < 3.0 * found.estimates["period"].u
    assert found.estimates["amplitude"].u < 4e-3


def test_a_bent_phase_is_no_second_oscillation() -> None:
    """A frequency that falls with the square of the amplitude is named for what it is, and nothing beside it."""
    for seed in range(6):
        codes = {one.code for one in analysed(seed, 0.0, cubic=60.0).findings}
        assert "amplitude_dependent_frequency" in codes
        assert "amplitude_modulated" not in codes


def test_what_flutters_from_window_to_window_is_not_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    """A bob that a fast second oscillation disturbs costs no fit of two slow ones; a slow one does."""
    searched: list[int] = []
    real = modulation._two_oscillations
    monkeypatch.setattr(modulation, "_two_oscillations", lambda *of: searched.append(len(of)) or real(*of))
    rng = np.random.default_rng(3)
    size = AMPLITUDE * np.exp(-RATE * T) + 2e-3 * np.repeat(rng.standard_normal(T.size // 75), 75)
    y = 0.3 + size * np.cos(OMEGA * T) + 3e-4 * rng.standard_normal(T.size)
    analyse(Track.from_arrays(T, y))
    assert searched == []
    analysed(0, 2e-3)
    assert searched != []
