"""What is peculiar to single recordings; what every one reads as is held by the goldens."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from acquisition.block import Flag
from acquisition.recordings.identify import open_recording
from acquisition.recordings.reading import ReadOptions

FILO = "filo0509__smorzamento/molla_durissima_discopieno_14.91945_0.2016_1.csv"


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
