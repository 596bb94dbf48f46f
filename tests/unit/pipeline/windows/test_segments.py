"""The part in which one free oscillation runs is found; the hand, a restart, a touch and lost rows are left out."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.analyse import Analysis, analyse
from pipeline.track import Quality, Track
from tests.sampling import sampled

OMEGA, GAMMA, REST, SIGMA = 8.3, 0.012, 0.32, 3e-4
T = np.arange(2500) / 100


def free(amplitude: float, since: float, phase: float = 0.0) -> np.ndarray:
    """Return a free oscillation that begins at a moment."""
    return amplitude * np.exp(-GAMMA * (T - since)) * np.cos(OMEGA * (T - since) + phase)


def analysed(x: np.ndarray, seed: int = 1) -> Analysis:
    """Return the analysis of a displacement with white noise."""
    noise = SIGMA * np.random.default_rng(seed).standard_normal(x.size)
    return analyse(Track.from_arrays(T[: x.size], REST + x + noise))


def codes(analysis: Analysis) -> set[str]:
    """Return the codes of findings on parts of the record."""
    known = {"at_rest", "handled", "restarted", "touched", "phase_jump"}
    return known & {finding.code for finding in analysis.findings}


def hold(analysis: Analysis, amplitude_at_0: float, since: float) -> None:
    """Demand period, rest position, damping rate and the amplitude of the part's own start within 4 u."""
    start = T[np.flatnonzero(analysis.flags & np.uint8(Quality.OUTSIDE) == 0)[0]]
    true = {
        "period": 2.0 * math.pi / OMEGA,
        "offset": REST,
        "damping_rate": GAMMA,
        "amplitude": amplitude_at_0 * math.exp(-GAMMA * (start - since)),
    }
    for name, value in true.items():
        estimate = analysis.estimates[name]
        assert abs(estimate.value - value) < 4.0 * estimate.u, name


def test_a_plain_record_is_one_part() -> None:
    """Nothing is left out where one oscillation runs from the first sample to the last."""
    found = analysed(free(0.05, 0.0, 0.3))
    assert found.quality["outside"] == 0
    assert codes(found) == set()


@pytest.mark.parametrize("held", [False, True], ids=["hangs and is lifted", "held"])
def test_the_hand_at_the_start_is_left_out(held: bool) -> None:
    """Three seconds in the hand, or at rest and a lift of half a second, change no estimate."""
    lift = np.full(T.size, 1.0) if held else np.clip((T - 3.0) / 0.5, 0.0, 1.0) ** 2
    found = analysed(np.where(T < 3.6, 0.045 * lift, free(0.045, 3.6)))
    assert codes(found) & {"handled", "at_rest"}
    outside = (found.flags & np.uint8(Quality.OUTSIDE)) != 0
    assert outside[T < 3.5].all()
    assert 3.5 < T[~outside][0] < 5.3
    assert np.count_nonzero(outside) == found.quality["outside"]
    hold(found, 0.045, 3.6)


def test_the_hand_at_the_end_is_left_out() -> None:
    """A bob that is caught and held for the last six seconds is analysed up to there."""
    found = analysed(np.where(T < 18.0, free(0.05, 0.0), 0.012))
    assert "handled" in codes(found)
    assert not (found.flags[T > 18.7] & np.uint8(Quality.OUTSIDE) == 0).any()
    hold(found, 0.05, 0.0)


def test_of_two_releases_the_longer_is_analysed() -> None:
    """The restart is reported with its time, and the part after it gives the numbers."""
    pause = np.interp(T, [8.0, 9.0], [0.02, 0.035])
    found = analysed(np.where(T < 8.0, free(0.05, 0.0), np.where(T < 11.5, pause, free(0.035, 11.5))))
    assert "restarted" in codes(found)
    (finding,) = (finding for finding in found.findings if finding.code == "restarted")
    assert 7.0 < finding.values["time_s"] < 12.0
    hold(found, 0.035, 11.5)


def test_a_touch_splits_the_record() -> None:
    """A touch that takes a tenth of the amplitude ends one part and begins the other, which is longer."""
    found = analysed(np.where(T < 9.7, free(0.05, 0.0), free(0.045, 0.0, 0.05)))
    assert codes(found) == {"touched"}
    hold(found, 0.045, 0.0)


def test_a_phase_that_jumps_splits_the_record() -> None:
    """Half a period of rows lost with times that were counted: the longer part's period and damping are right."""
    x = free(0.05, 0.0)
    found = analysed(np.concatenate([x[:1500], x[1540:]]))
    assert codes(found) == {"phase_jump"}
    hold(found, 0.05, 0.0)


def test_rest_long_before_the_end_is_left_out() -> None:
    """Of a minute and a half in which the bob moves for ten seconds the rest is left out, and the numbers hold."""
    t = np.arange(9000) / 100
    noise = SIGMA * np.random.default_rng(4).standard_normal(t.size)
    found = analyse(Track.from_arrays(t, REST + 0.05 * np.exp(-0.35 * t) * np.cos(OMEGA * t) + noise))
    assert codes(found) == {"at_rest"}
    assert found.quality["outside"] > 0.4 * t.size
    assert abs(found.estimates["damping_rate"].value - 0.35) < 4.0 * found.estimates["damping_rate"].u


@pytest.mark.parametrize(("amplitude", "angle", "code"), [(0.015, 0.0, "touched"), (0.0, 0.015, "phase_jump")])
def test_a_light_touch_ends_the_part_that_is_analysed(amplitude: float, angle: float, code: str) -> None:
    """A change of 1.5 % is named with its time, and the numbers are those of the longer part."""
    found = analysed(free(0.05, 0.0) * np.where(T < 15.0, 1.0, 1.0 + amplitude) if amplitude else turned(angle))
    (finding,) = (one for one in found.findings if one.code == code)
    assert 14.0 <= finding.values["time_s"] < 16.0
    assert abs(found.estimates["damping_rate"].value - GAMMA) < 4.0 * found.estimates["damping_rate"].u


def turned(angle: float) -> np.ndarray:
    """Return a free oscillation whose phase jumps at 15 s."""
    return np.where(T < 15.0, free(0.05, 0.0), free(0.05, 0.0, angle))


@pytest.mark.parametrize("seed", sampled(range(20)))
@pytest.mark.parametrize("bend", [0.0, 1e-3])
def test_what_runs_smoothly_is_not_parted(bend: float, seed: int) -> None:
    """Neither noise nor a phase that bends by half a radian is a touch."""
    found = analysed(0.05 * np.exp(-GAMMA * T) * np.cos(OMEGA * T + bend * T**2), seed)
    assert not codes(found) & {"touched", "phase_jump", "handled"}


@pytest.mark.parametrize("seed", sampled(range(4), 1))
def test_an_amplitude_that_goes_to_and_fro_is_not_touched(seed: int) -> None:
    """Energy given away and taken back every twelve seconds is no jump."""
    found = analysed(free(0.05, 0.0) * (1.0 + 0.15 * np.cos(2.0 * np.pi * T / 12.0 + seed)), seed)
    assert not codes(found) & {"touched", "phase_jump"}
