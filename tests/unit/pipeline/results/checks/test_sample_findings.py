"""Clusters of false echoes are counted, placed in the motion and weighed by what they would do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pipeline.oscillation.demodulate import Demodulated
from pipeline.results.checks.sample_findings import Clusters, find_clusters

Windows = Callable[..., Demodulated]


def spoilt(windows: Windows, rows: list[int], away_m: float) -> Demodulated:
    """Return 20 windows of 76 samples in which some samples are false by so much."""
    points = windows(0.4 + 0.757 * np.arange(20), 0.05)
    flags, residual = points.flags.copy(), points.residual.copy()
    flags[rows], residual[rows] = 2, away_m
    return replace(points, flags=flags, residual=residual)


def test_clusters_are_counted_where_they_lie(windows: Windows) -> None:
    """Runs of three and more, two good samples bridged, count; single echoes do not; crests are told from slopes."""
    angle = 2 * np.pi * np.arange(1520) / 76
    crest, slope = [76, 77, 78, 80, 81], [76 * 5 + 18, 76 * 5 + 19, 76 * 5 + 20]
    single = [76 * 9 + 40, 76 * 10 + 3]
    found = find_clusters(spoilt(windows, [*crest, *slope, *single], 1e-3), angle.__getitem__)
    assert (found.count, found.samples, found.turning) == (2, 8, 1)


def test_shift_is_what_least_squares_would_have_made_of_them(windows: Windows) -> None:
    """Echoes 10 mm off on every crest would raise the amplitude as a fit with them shows."""
    angle = 2 * np.pi * np.arange(1520) / 76
    rows = [76 * k + j for k in range(20) for j in (0, 1, 2, 3)]
    false = np.zeros(1520)
    false[rows] = 0.01
    design = np.stack([np.ones(1520), np.cos(angle), np.sin(angle)], axis=1)
    expected = np.linalg.lstsq(design, false, rcond=None)[0][1]
    found = find_clusters(spoilt(windows, rows, 0.01), angle.__getitem__)
    assert found.shift_m == pytest.approx(expected, rel=0.02)
    assert found.turning == found.count == 20


def test_no_echo_no_cluster(windows: Windows) -> None:
    """A clean record has none."""
    assert find_clusters(spoilt(windows, [], 0.0), np.zeros(1520).__getitem__) == Clusters(0, 0, 0, 0.0)
