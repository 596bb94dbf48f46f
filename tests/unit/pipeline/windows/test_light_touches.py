"""A touch too light to be seen from one period to the next is found in all of them together."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.analyse import analyse
from pipeline.track import F8, Track

OMEGA = 8.3
T: F8 = np.arange(2500) / 100.0


def record(seed: int, *, amplitude: float = 0.0, angle: float = 0.0, bend: float = 0.0) -> Track:
    """Return a bob whose amplitude and phase change at 15 s by a share and an angle, and whose phase bends."""
    size = 0.05 * np.exp(-0.012 * T) * np.where(T < 15.0, 1.0, 1.0 + amplitude)
    phase = OMEGA * T + bend * T**2 + np.where(T < 15.0, 0.0, angle)
    return Track.from_arrays(T, 0.3 + size * np.cos(phase) + 3e-4 * np.random.default_rng(seed).standard_normal(T.size))


@pytest.mark.parametrize(("amplitude", "angle", "code"), [(0.015, 0.0, "touched"), (0.0, 0.015, "phase_jump")])
def test_a_light_touch_ends_the_part_that_is_analysed(amplitude: float, angle: float, code: str) -> None:
    """A change of 1.5 % is named with its time, and the numbers are those of the longer part."""
    for seed in range(4):
        found = analyse(record(seed, amplitude=amplitude, angle=angle))
        (finding,) = (one for one in found.findings if one.code == code)
        assert 14.0 <= finding.values["time_s"] < 16.0
        rate = found.estimates["damping_rate"]
        assert abs(rate.value - 0.012) < 4.0 * rate.u


@pytest.mark.parametrize("bend", [0.0, 1e-3])
def test_what_runs_smoothly_is_not_parted(bend: float) -> None:
    """Neither noise nor a phase that bends by half a radian is a touch."""
    for seed in range(20):
        codes = {one.code for one in analyse(record(seed, bend=bend)).findings}
        assert not codes & {"touched", "phase_jump", "handled"}


def test_an_amplitude_that_goes_to_and_fro_is_not_touched() -> None:
    """Energy given away and taken back every twelve seconds is faster than the polynomials, and still no jump."""
    t = np.arange(4000) / 100.0
    for seed in range(4):
        noise = 3e-4 * np.random.default_rng(seed).standard_normal(t.size)
        size = 0.05 * np.exp(-0.012 * t) * (1.0 + 0.15 * np.cos(2.0 * np.pi * t / 12.0 + seed))
        found = analyse(Track.from_arrays(t, 0.3 + size * np.cos(OMEGA * t) + noise))
        assert not {one.code for one in found.findings} & {"touched", "phase_jump"}
