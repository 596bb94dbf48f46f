"""Times in bursts: samples that a computer stamped together are spread evenly, or the file is asked about."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.block import F8
from acquisition.errors import NeedsAnswer
from acquisition.recordings.identify import open_recording
from tests.sampling import sampled

TRUE = 0.01 * np.arange(3000)


def polled(interval_s: float, apart_s: float = 1e-4) -> F8:
    """Stamps of a computer that asks every so often, up to 2 ms late, and reads all that is waiting."""
    burst = np.floor(TRUE / interval_s).astype(np.int64)
    late = 0.002 * np.random.default_rng(4).random(burst[-1] + 1)
    within = np.arange(TRUE.size) - np.searchsorted(burst, burst)
    return np.asarray((burst + 1) * interval_s + late[burst] + apart_s * within)


def written(folder: Path, t: F8, decimals: int) -> Path:
    """Return a recording with these times."""
    path = folder / "times.csv"
    y = 0.4 + 0.03 * np.cos(9.52 * np.arange(t.size) * 0.01)
    rows = (f"{a:.{decimals}f},{b:.5f}" for a, b in zip(t, y, strict=True))
    path.write_text("\n".join(["time (s),distance (m)", *rows, ""]), encoding="utf-8")
    return path


@pytest.mark.parametrize("decimals", [6, 3])
@pytest.mark.parametrize("interval_s", sampled([0.1, 0.035, 0.05, 0.04, 0.16]))
def test_bursts_are_spread_evenly(tmp_path: Path, interval_s: float, decimals: int) -> None:
    """The rate is right to the lateness of the stamps over 30 s, and every sample is kept; a finding says so."""
    found = open_recording(written(tmp_path, polled(interval_s), decimals))
    t = found.samples.t
    assert found.info.rate_hz == pytest.approx(100.0, rel=1e-4)
    assert np.diff(t) == pytest.approx(np.full(2999, 0.01), rel=1e-3)
    assert not found.samples.flags.any()
    assert [trap.code for trap in found.traps if trap.code in ("times_in_bursts", "nominal_clock")] == [
        "times_in_bursts"
    ]


def test_bursts_with_missing_samples_are_asked_about(tmp_path: Path) -> None:
    """Where half a second is missing nobody knows which samples: the rate must be given."""
    t = np.delete(polled(0.05), np.s_[1000:1050])
    path = written(tmp_path, t, 6)
    with pytest.raises(NeedsAnswer):
        open_recording(path)
    assert open_recording(path, rate_hz=100.0).info.rate_hz == 100.0


@pytest.mark.parametrize(
    "t",
    [TRUE, TRUE + 0.003 * np.random.default_rng(1).random(TRUE.size), np.delete(TRUE, np.s_[500:1500])],
    ids=["even", "late", "gap"],
)
def test_other_times_are_no_bursts(tmp_path: Path, t: F8) -> None:
    """Even times, late times and a gap are not spread."""
    found = open_recording(written(tmp_path, t, 6))
    assert "times_in_bursts" not in {trap.code for trap in found.traps}
    np.testing.assert_allclose(found.samples.t, t, rtol=0, atol=1e-6)
