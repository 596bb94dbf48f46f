"""Conditioning flags what a fit may not take at face value, drops nothing and touches nothing else."""

from __future__ import annotations

from types import ModuleType

import numpy as np
import pytest

from pipeline.analyse import analyse
from pipeline.errors import AnalysisError
from pipeline.samples.condition import condition, fourth_difference_noise
from pipeline.track import Quality, Track


def swing(synthetic: ModuleType, seconds: float = 10.0, sigma_m: float = 1e-4, seed: int = 1) -> tuple[np.ndarray, ...]:
    """Return times and distances of a bob."""
    t = synthetic.times(seconds)
    return t, synthetic.noisy(synthetic.Truth(), t, sigma_m, seed)


def rows(flags: np.ndarray, bit: Quality) -> list[int]:
    """Return the rows that carry a flag."""
    found: list[int] = np.flatnonzero(flags & np.uint8(bit)).tolist()
    return found


@pytest.mark.parametrize("sigma_m", [1e-5, 3e-4, 2.39e-3])
def test_clean_record_keeps_every_sample(synthetic: ModuleType, sigma_m: float) -> None:
    """Normal noise of any size is not taken for anything else."""
    flagged = 0
    for seed in range(20):
        t, y = swing(synthetic, sigma_m=sigma_m, seed=seed)
        found = condition(Track.from_arrays(t, y))
        flagged += np.count_nonzero(found.flags)
        assert found.plateaus_m == ()
    assert flagged == 0


def test_missing_samples_are_flagged_and_keep_their_place(synthetic: ModuleType) -> None:
    """NaN and infinity are no distances."""
    t, y = swing(synthetic)
    y[[3, 500]] = np.nan
    y[700] = np.inf
    found = condition(Track.from_arrays(t, y))
    assert rows(found.flags, Quality.MISSING) == [3, 500, 700]
    assert len(found.flags) == len(found.track) == 1000
    assert np.count_nonzero(found.used) == 997


def test_times_that_repeat_or_run_back_are_flagged(synthetic: ModuleType) -> None:
    """A repeated time is a duplicate, one behind the latest is not monotonic, and so is one that is no number."""
    t, y = swing(synthetic)
    t[10] = t[9]
    t[20] = t[18]
    t[30] = np.nan
    t[40] = t[45]  # a leap forward: rows 41 to 44 are then behind it, row 45 repeats it
    found = condition(Track.from_arrays(t, y))
    assert rows(found.flags, Quality.DUPLICATE_TIME) == [10, 45]
    assert rows(found.flags, Quality.NON_MONOTONIC_TIME) == [20, 30, 41, 42, 43, 44]


def test_flags_of_the_recording_stay(synthetic: ModuleType) -> None:
    """Bits known before the analysis are kept, and a gap before a sample does not keep it out."""
    t, y = swing(synthetic)
    flags = np.zeros(1000, np.uint8)
    flags[5], flags[6] = Quality.MALFORMED, Quality.GAP_BEFORE
    track = Track.from_arrays(t, y, flags=flags)
    found = condition(track)
    assert (found.flags[5], found.flags[6]) == (Quality.MALFORMED, Quality.GAP_BEFORE)
    assert (found.used[5], found.used[6]) == (False, True)
    assert track.flags is not found.flags
    np.testing.assert_array_equal(track.flags, flags)


@pytest.mark.parametrize("height_m", [0.02, 0.3, 2.0, -0.1])
@pytest.mark.parametrize("row", [1, 2, 400, 425, 500, 997, 998])
def test_lone_spike_is_found(synthetic: ModuleType, height_m: float, row: int) -> None:
    """A single echo from elsewhere is flagged, whatever the bob does there."""
    t, y = swing(synthetic)
    y[row] += height_m
    assert row in rows(condition(Track.from_arrays(t, y)).flags, Quality.FALSE_ECHO)


@pytest.mark.parametrize("height_m", [0.02, 2.0, -0.1])
@pytest.mark.parametrize("row", [2, 400, 425, 500, 997])
def test_lone_spike_does_not_take_its_neighbours_along(synthetic: ModuleType, height_m: float, row: int) -> None:
    """One false echo is flagged alone, at the crest as on the slope."""
    t, y = swing(synthetic)
    y[row] += height_m
    assert rows(condition(Track.from_arrays(t, y)).flags, Quality.FALSE_ECHO) == [row]


@pytest.mark.parametrize("row", [2, 400, 425, 500, 996])
def test_pair_of_spikes_is_found(synthetic: ModuleType, row: int) -> None:
    """Two false echoes side by side are flagged, with two neighbours at the most."""
    t, y = swing(synthetic)
    y[[row, row + 1]] += 0.5
    found = rows(condition(Track.from_arrays(t, y)).flags, Quality.FALSE_ECHO)
    assert {row, row + 1} <= set(found)
    assert len(found) <= 4


@pytest.mark.parametrize("row", [0, 999])
def test_spike_at_either_end_is_found_in_the_end(synthetic: ModuleType, row: int) -> None:
    """What conditioning cannot tell at the very first and last sample, the windows' fits do."""
    t, y = swing(synthetic)
    y[row] += 0.3
    assert row in rows(analyse(Track.from_arrays(t, y)).flags, Quality.FALSE_ECHO)


@pytest.mark.parametrize("share", [0.1, 0.2, 0.3])
@pytest.mark.parametrize("side", [1, -1])
def test_clipped_crest_is_found(synthetic: ModuleType, share: float, side: int) -> None:
    """Where a fixed object cuts a share of every cycle, those samples are clipped and the level is named."""
    truth = synthetic.Truth()
    t = synthetic.times(20)
    clean = truth.position(t)
    level = truth.offset + side * truth.amplitude * np.cos(np.pi * share)
    cut = side * (clean - level) > 0
    y = np.where(cut, level, clean) + 1e-4 * np.random.default_rng(4).standard_normal(t.size)
    found = condition(Track.from_arrays(t, y))
    assert found.plateaus_m == (pytest.approx(level, abs=2e-4),)
    flagged = (found.flags & np.uint8(Quality.CLIPPED)) > 0
    assert np.mean(flagged[cut]) > 0.95
    assert np.count_nonzero(flagged & ~cut) <= 0.02 * t.size


def test_clipping_on_both_sides_is_found(synthetic: ModuleType) -> None:
    """Two objects make two plateaus."""
    t = synthetic.times(20)
    y = np.clip(synthetic.Truth().position(t), 0.185, 0.255) + 1e-4 * np.random.default_rng(5).standard_normal(t.size)
    assert sorted(condition(Track.from_arrays(t, y)).plateaus_m) == [
        pytest.approx(0.185, abs=2e-4),
        pytest.approx(0.255, abs=2e-4),
    ]


@pytest.mark.parametrize("sigma_m", [1e-5, 3e-4, 2.39e-3])
def test_noise_is_measured_without_a_model(synthetic: ModuleType, sigma_m: float) -> None:
    """Fourth differences give the noise within 5 % on average, whatever the motion beneath."""
    found = [condition(Track.from_arrays(*swing(synthetic, sigma_m=sigma_m, seed=s))).noise_m for s in range(20)]
    assert float(np.mean(found)) == pytest.approx(sigma_m, rel=0.05)


def test_false_echoes_do_not_raise_the_noise(synthetic: ModuleType) -> None:
    """One spike in fifty changes the measured noise by less than a quarter."""
    t, y = swing(synthetic, seed=6)
    y[25::50] += 0.4
    assert condition(Track.from_arrays(t, y)).noise_m == pytest.approx(1e-4, rel=0.25)


@pytest.mark.parametrize("count", [0, 1, 4])
def test_noise_of_too_few_samples_is_none(count: int) -> None:
    """Fewer than five samples have no fourth difference."""
    assert fourth_difference_noise(np.arange(float(count))) == 0.0


def test_noise_of_a_cubic_is_none() -> None:
    """What a polynomial of third degree does is motion, not noise."""
    assert fourth_difference_noise(np.arange(50.0) ** 3) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("usable", [0, 1, 7])
def test_too_few_usable_samples_are_refused(usable: int) -> None:
    """Under eight usable samples the refusal says how many there were and of how many."""
    y = np.full(100, np.nan)
    y[:usable] = 0.2
    with pytest.raises(AnalysisError, match=f"eight usable samples .* got {usable} of 100"):
        condition(Track.from_arrays(np.arange(100) / 100, y))


def test_a_refusal_names_what_was_flagged() -> None:
    """A record written backwards is refused with the count of samples whose time runs backward."""
    t = np.arange(100)[::-1] / 100
    with pytest.raises(AnalysisError, match=r"got 1 of 100 \(flagged: 99 non_monotonic_time\)"):
        condition(Track.from_arrays(t, 0.2 + 0.01 * np.cos(8.3 * t), rate_hz=100.0))


@pytest.mark.parametrize("usable", [8, 9, 12])
def test_eight_usable_samples_are_enough(usable: int) -> None:
    """From eight on a record is judged."""
    y = np.full(100, np.nan)
    y[:usable] = 0.2 + 0.01 * np.arange(usable)
    assert np.count_nonzero(condition(Track.from_arrays(np.arange(100) / 100, y)).used) == usable


def test_step_between_two_levels_is_no_pair_of_plateaus() -> None:
    """A distance that jumps once leaves samples to work with: not all of them are clipped."""
    t = np.arange(1000) / 100
    y = 0.2 + 0.05 * (t > 5.0) + 1e-4 * np.random.default_rng(2).standard_normal(1000)
    assert np.count_nonzero(condition(Track.from_arrays(t, y)).used) >= 8


def test_same_record_same_flags(synthetic: ModuleType) -> None:
    """Conditioning is a function of the track alone and leaves it as it was."""
    t, y = swing(synthetic)
    y[100] += 1.0
    track = Track.from_arrays(t, y)
    first, second = condition(track), condition(track)
    np.testing.assert_array_equal(first.flags, second.flags)
    np.testing.assert_array_equal(track.y, y)


def test_rest_does_not_tell_the_curvature_of_the_start() -> None:
    """At ten samples a second a bob that comes to rest between two steps of its sensor keeps its first crests."""
    t = np.arange(12_000) / 10.0
    y = 0.3 + 0.05 * np.exp(-0.012 * t) * np.cos(4.2 * t) + 3e-6 * np.random.default_rng(2).standard_normal(t.size)
    assert not rows(condition(Track.from_arrays(t, np.round(y / 43e-6) * 43e-6)).flags, Quality.FALSE_ECHO)
