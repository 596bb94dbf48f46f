"""Clusters of false echoes are counted, placed in the motion and weighed by what they would do."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pipeline.analyse import Oscillation, analyse
from pipeline.checks.echoes import Clusters, count_quality, echoes_by_chance, find_clusters
from pipeline.track import F8, U8, Track

OMEGA = 2.0 * np.pi / 0.76  # a period of 76 samples
T: F8 = np.arange(1520) / 100.0


@cache
def motion() -> Oscillation:
    """Return a run of twenty periods, whose crests lie at rows 0, 76, 152 and so on."""
    y = 0.3 + 0.05 * np.cos(OMEGA * T) + 1e-5 * np.random.default_rng(1).standard_normal(T.size)
    found = analyse(Track.from_arrays(T, y)).motion
    assert isinstance(found, Oscillation)
    return found


def clusters(rows: list[int], away_m: float) -> Clusters:
    """Return the clusters where some samples are false by so much."""
    windows, phase = motion().demodulated, motion().phase
    flags, residual = np.zeros_like(windows.flags), windows.residual.copy()
    flags[rows], residual[rows] = 2, away_m
    return find_clusters(Track.from_arrays(T, T), replace(windows, flags=flags, residual=residual), phase)


def test_clusters_are_counted_where_they_lie() -> None:
    """Three and more in a row, two good samples bridged, count; single echoes do not; crests differ from slopes."""
    crest, slope = [76, 77, 78, 80, 81], [76 * 5 + 18, 76 * 5 + 19, 76 * 5 + 20]
    single = [76 * 9 + 40, 76 * 10 + 3]
    found = clusters([*crest, *slope, *single], 1e-3)
    assert (found.count, found.samples, found.turning) == (2, 8, 1)


def test_shift_is_that_of_a_fit_that_keeps_them() -> None:
    """Echoes 10 mm off on every crest would raise the amplitude as a fit with them shows."""
    rows = [76 * k + j for k in range(20) for j in (0, 1, 2, 3)]
    false = np.zeros(T.size)
    false[rows] = 0.01
    design = np.stack([np.ones(T.size), np.cos(OMEGA * T), np.sin(OMEGA * T)], axis=1)
    expected = np.linalg.lstsq(design, false, rcond=None)[0][1]
    found = clusters(rows, 0.01)
    assert found.shift_m == pytest.approx(expected, rel=0.02)
    assert found.turning == found.count == 20


def test_no_echo_no_cluster() -> None:
    """A clean run has none."""
    assert clusters([], 0.0) == Clusters(0, 0, 0, 0.0)


def test_counts_of_quality() -> None:
    """Every flag is counted, one sample under each of its bits, and what is used is free of them."""
    flags: U8 = np.array([0, 1, 2, 2 | 4, 8, 16, 32, 64], np.uint8)
    assert count_quality(flags) == {
        "missing": 1,
        "false_echo": 2,
        "clipped": 1,
        "duplicate_time": 1,
        "non_monotonic_time": 1,
        "outside": 0,
        "used": 2,
    }


@pytest.mark.parametrize(
    ("rows", "away", "chance"), [([300], 4.1, True), ([300], 9.0, False), ([*range(300, 330, 3)], 4.1, False)]
)
def test_a_sample_that_noise_puts_out_is_no_echo(rows: list[int], away: float, chance: bool) -> None:
    """Noise explains a sample of 1,520 beyond four standard deviations, but neither one at nine nor ten of them."""
    windows = motion().demodulated
    flags, residual = np.zeros_like(windows.flags), windows.residual.copy()
    flags[rows], residual[rows] = 2, away * windows.noise_m
    found = replace(windows, flags=flags, residual=residual)
    assert echoes_by_chance(np.zeros_like(flags), found, 4.0) is chance
    assert not echoes_by_chance(flags, found, 4.0)
