"""What is peculiar to single recordings, as pairs of MotionSensor.vi; what every one reads as is a golden."""

from pathlib import Path

import numpy as np
import pytest

from acquisition.block import Flag
from acquisition.recordings.identify import open_recording
from acquisition.recordings.reading import ReadOptions

FILO = "filo0509__smorzamento/molla_durissima_discopieno_14.91945_0.2016_1.csv"
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


def test_a_channel_of_volts_is_a_voltage_unless_it_is_counted_as_a_length(recordings: Path) -> None:
    """The file's own unit says what a channel is of; one volt counts as a metre only where the user asks for it."""
    path = recordings / "caspar__PhysicsLab/Q1.txt"
    volts, metres = open_recording(path).samples, open_recording(path, ReadOptions(unit="m")).samples
    assert (volts.quantity, volts.unit, metres.quantity, metres.unit) == ("voltage", "V", "length", "m")
    assert volts.distance.tobytes() == metres.distance.tobytes()


def test_empty_edges_of_a_derived_column_are_missing_samples(recordings: Path) -> None:
    """One velocity and three accelerations are not there at the end; positions all are."""
    for channel, lost in (("position", 0), ("velocity", 1), ("acceleration", 3)):
        samples = open_recording(recordings / FILO, ReadOptions(channel=channel, unit="m")).samples
        assert np.flatnonzero(samples.flags & Flag.MISSING.value).tolist() == list(range(11886 - lost, 11886))
