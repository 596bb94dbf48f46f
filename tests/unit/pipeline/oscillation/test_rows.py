"""Rows that are lost, or of two records in turn, are told from the distances."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.analyse import Still, analyse
from pipeline.oscillation.condition import condition
from pipeline.oscillation.rows import are_interleaved, count_lost
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
    assert count_lost(condition(track)) == 0
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
