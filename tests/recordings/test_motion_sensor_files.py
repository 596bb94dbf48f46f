"""Real MotionSensor.vi files of velocity: alone, and joined to the positions of their run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.recordings.identify import open_recording

PANDHI = "AyushPandhi__Pandhi_Ayush_PHY224"


PAIRS = [
    (f"{PANDHI}/position data.txt", f"{PANDHI}/velocity data.txt", 0.00881),
    (f"{PANDHI}/damped position.txt", f"{PANDHI}/damped velocity.txt", 0.31433),
    ("kamjha__PHY224/position_osc.txt", "kamjha__PHY224/velocity_osc.txt", 0.32078),
]


@pytest.mark.parametrize(("position", "velocity", "second"), PAIRS)
def test_a_velocity_file_alone(recordings: Path, position: str, velocity: str, second: float) -> None:
    """Summed up, velocity is the position within two of its printed digits, but for the offset."""
    alone = open_recording(recordings / velocity)
    there = open_recording(recordings / position).samples.distance
    assert alone.channel == "velocity"
    assert alone.samples.velocity is not None
    assert np.isnan(alone.samples.velocity[0])
    assert alone.samples.velocity[1] == second
    assert alone.samples.distance[0] == 0.0
    assert np.ptp(alone.samples.distance - there) < 2e-5
    assert alone.info.quantum_m is None
    assert "offset_unknown" in {trap.code for trap in alone.traps}
    assert not alone.samples.flags.any()


@pytest.mark.parametrize(("position", "velocity", "second"), PAIRS)
def test_a_pair(recordings: Path, position: str, velocity: str, second: float) -> None:
    """Both files of a run join without a hole."""
    pair = open_recording(recordings / position, velocity_path=recordings / velocity)
    alone = open_recording(recordings / position)
    assert pair.samples.velocity is not None
    np.testing.assert_array_equal(pair.samples.distance, alone.samples.distance)
    assert pair.samples.velocity[1] == second
    assert pair.info.quantum_m == pytest.approx(alone.info.quantum_m)
    assert {trap.code for trap in pair.traps} == {"nominal_clock", "stated_error_is_not_noise"}
    assert len(pair.originals) == 2
