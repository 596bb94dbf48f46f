"""What is peculiar to single recordings, as pairs of MotionSensor.vi; what every one reads as is a golden."""

from pathlib import Path

import numpy as np
import pytest

from acquisition.recordings.identify import open_recording
from acquisition.recordings.reading import ReadOptions

PANDHI = "AyushPandhi__Pandhi_Ayush_PHY224"


@pytest.mark.parametrize(
    ("position", "velocity", "second"),
    [
        (f"{PANDHI}/position data.txt", f"{PANDHI}/velocity data.txt", 0.00881),
        (f"{PANDHI}/damped position.txt", f"{PANDHI}/damped velocity.txt", 0.31433),
        ("kamjha__PHY224/position_osc.txt", "kamjha__PHY224/velocity_osc.txt", 0.32078),
    ],
)
def test_a_pair(recordings: Path, position: str, velocity: str, second: float) -> None:
    """Both files of a run join without a hole; alone, summed up, velocity is the position but for the offset."""
    there, alone = open_recording(recordings / position), open_recording(recordings / velocity)
    pair = open_recording(recordings / position, ReadOptions(velocity=recordings / velocity))
    assert alone.channel == "velocity"
    for each in (alone.samples.velocity, pair.samples.velocity):
        assert each is not None
        assert each[1] == second
    assert np.isnan(alone.samples.velocity[0])
    assert alone.samples.distance[0] == 0.0
    assert np.ptp(alone.samples.distance - there.samples.distance) < 2e-5  # two of its printed digits
    assert alone.info.quantum_m is None
    assert "offset_unknown" in {trap.code for trap in alone.traps}
    assert not alone.samples.flags.any()
    np.testing.assert_array_equal(pair.samples.distance, there.samples.distance)
    assert pair.info.quantum_m == pytest.approx(there.info.quantum_m)
    assert {trap.code for trap in pair.traps} == {"nominal_clock", "stated_error_is_not_noise"}
    assert len(pair.originals) == 2
