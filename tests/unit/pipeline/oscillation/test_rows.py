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


def test_lost_rows_are_counted() -> None:
    """Of a twentieth of the rows lost while times were counted, most are counted, and the finding says so."""
    kept = np.random.default_rng(5).random(T.size) >= 0.05
    track = noisy(PLAIN[kept])
    assert count_lost(condition(track)) == pytest.approx(np.count_nonzero(~kept), rel=0.3)
    assert "rows_lost" in {finding.code for finding in analyse(track).findings if finding.severity == "error"}


def test_two_records_in_turn_are_refused() -> None:
    """Rows of two bobs in turn give no period."""
    other = 0.32 + 0.04 * np.cos(9.3 * T)
    found = analyse(noisy(np.where(np.arange(T.size) % 2, other, PLAIN)))
    assert isinstance(found.motion, Still)
    assert found.findings[0].code == "interleaved_records"
    assert "period" not in found.estimates
