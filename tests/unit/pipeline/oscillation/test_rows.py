"""Rows that are lost, or of two records in turn, are told from the distances."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.analyse import Still, analyse
from pipeline.oscillation.condition import condition
from pipeline.oscillation.rows import are_interleaved, count_doubled, count_lost, hum_in_turn
from pipeline.track import Track

T = np.arange(3000) / 100
PLAIN = 0.3 + 0.05 * np.exp(-0.01 * T) * np.cos(8.3 * T)


def noisy(y: np.ndarray, sigma: float = 3e-4) -> Track:
    """Return a track of distances with white noise, its times counted."""
    return Track.from_arrays(T[: y.size], y + sigma * np.random.default_rng(3).standard_normal(y.size))


@pytest.mark.parametrize("sigma", [1e-5, 3e-4, 2.39e-3])
def test_a_plain_record_has_all_its_rows(sigma: float) -> None:
    """No row of a plain record counts as lost, and it is one record."""
    track = noisy(PLAIN, sigma)
    assert count_lost(condition(track)) == count_doubled(condition(track)) == 0
    assert not are_interleaved(track)


@pytest.mark.parametrize("share", [0.05, 0.3])
def test_lost_rows_are_counted(share: float) -> None:
    """Of rows lost while times were counted, most are counted, the finding says so, and the period's u covers."""
    kept = np.random.default_rng(5).random(T.size) >= share
    track = noisy(PLAIN[kept])
    assert count_lost(condition(track)) == pytest.approx(np.count_nonzero(~kept), rel=0.4)
    found = analyse(track)
    assert "rows_lost" in {finding.code for finding in found.findings if finding.severity == "error"}
    period = found.estimates["period"]
    assert abs(period.value - 2.0 * np.pi / 8.3) < 3.0 * period.u


def test_two_records_in_turn_are_refused() -> None:
    """Rows of two bobs in turn give no period."""
    other = 0.32 + 0.04 * np.cos(9.3 * T)
    found = analyse(noisy(np.where(np.arange(T.size) % 2, other, PLAIN)))
    assert isinstance(found.motion, Still)
    assert found.findings[0].code == "interleaved_records"
    assert "period" not in found.estimates


@pytest.mark.parametrize("step_m", [0.0, 1e-3], ids=["fine", "1 mm"])
def test_doubled_rows_are_counted(step_m: float) -> None:
    """Of rows written twice at random, most are counted, the finding says so, and the period's u covers."""
    rows = np.sort(np.r_[np.arange(T.size), np.random.default_rng(7).choice(T.size, T.size // 5, replace=False)])
    y = noisy(PLAIN).y
    y = (np.round(y / step_m) * step_m if step_m else y)[rows]
    track = Track.from_arrays(np.arange(rows.size) / 100, y)
    assert count_doubled(condition(track)) == pytest.approx(T.size // 5, rel=0.3)
    found = analyse(track)
    assert "rows_doubled" in {finding.code for finding in found.findings if finding.severity == "error"}
    period = found.estimates["period"]
    assert abs(period.value - 2.0 * np.pi / 8.3) < 3.0 * period.u


@pytest.mark.parametrize("fresh_hz", [25.0, 80.0])
def test_values_of_a_slower_sensor_are_not_doubled_rows(fresh_hz: float) -> None:
    """A sensor slower than the record repeats its values at regular gaps, and times are right."""
    fresh = np.floor(T * fresh_hz + 1e-9)
    track = noisy(PLAIN)
    assert count_doubled(condition(Track.from_arrays(T, track.y[np.searchsorted(fresh, fresh)]))) == 0


@pytest.mark.parametrize(("size", "step_m"), [(25, 0.0), (1, 5e-3)], ids=["median", "steps"])
def test_alike_neighbours_are_not_doubled_rows(size: int, step_m: float) -> None:
    """Distances behind a median, and in coarse steps, are often alike without a row too many."""
    y = noisy(PLAIN, 2.39e-3).y
    y = np.median(np.lib.stride_tricks.sliding_window_view(y, size), axis=1)
    y = np.round(y / step_m) * step_m if step_m else y
    assert count_doubled(condition(Track.from_arrays(T[: y.size], y))) == 0


def test_hum_at_half_the_rate_is_no_second_record() -> None:
    """Hum that alternates from row to row is named so; at a rate that does not fold the mains there, it is not."""
    hum = 2e-3 * np.sin(2 * np.pi * 49.98 * T)
    track = noisy(PLAIN + hum)
    assert hum_in_turn(track) == pytest.approx(2e-3 / np.sqrt(2.0), rel=0.1)
    found = analyse(track)
    assert isinstance(found.motion, Still)
    assert found.findings[0].code == "mains_hum"
    assert hum_in_turn(Track.from_arrays(T * 1.1, track.y)) is None
