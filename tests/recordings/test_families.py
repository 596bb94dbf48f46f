"""Every real file: family, rate, samples, units and values as counted by awk and npTDMS, not by the readers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from acquisition.block import Flag, concatenate
from acquisition.recordings.identify import inspect, open_recording, sniff

PANDHI = "AyushPandhi__Pandhi_Ayush_PHY224"
MATTIA = "Mattia04__Smorzamento/Oscillazioni pretensionata_cd_5e7masse.csv"
FILO = "filo0509__smorzamento/molla_durissima_discopieno_14.91945_0.2016_1.csv"
SHM = "High-Rate-SHM-Working-Group__Dataset-5-Extended-Impact-Testing/Test_002.lvm"
TDMS = "adamreeve__npTDMS/big_endian.tdms"
PHYPHOX = "ubsuny__data-analysis-final20/Raw Data.csv"
TRACKER = "EroSkulled__PHY224-324/Data2.csv"


@dataclass(frozen=True)
class Row:
    """One channel of one file.

    ``unit`` is what the file states; where that is no length the test counts one of it as one metre.
    """

    path: str
    family: str
    samples: int
    rate_hz: float
    t: tuple[float, float]
    ends: tuple[float, float]
    unit: str = "cm"
    channel: str | None = None
    run: str | None = None
    given_hz: float | None = None
    clock: str = "nominal"
    traps: frozenset[str] = frozenset()


STATED = frozenset({"nominal_clock", "stated_error_is_not_noise"})
SUMMED = frozenset({"nominal_clock", "offset_unknown"})
GRID = frozenset({"nominal_clock"})
FORCED = GRID | {"unit_assumed"}
UNTIMED = GRID | {"time_unit_assumed"}
GIVEN = GRID | {"unit_given"}

TABLE = [
    Row(f"{PANDHI}/position data.txt", "motion-sensor", 724, 100, (0.43, 7.66), (16.500, 16.647), traps=STATED),
    Row(f"{PANDHI}/velocity data.txt", "motion-sensor", 724, 100, (0.43, 7.66), (0, 0.147), "cm/s", traps=SUMMED),
    Row(
        MATTIA,
        "capstone",
        1875,
        50,
        (0, 37.48),
        (-19.6620, 3.2366),
        "mm",
        None,
        "Run #1",
        50.0,
        traps=GRID | {"rate_given"},
    ),
    Row("caspar__PhysicsLab/Q1.txt", "datastudio", 618, 10, (0, 61.7), (-0.009, -0.004), "V", traps=FORCED),
    Row(
        PHYPHOX,
        "phyphox",
        1170,
        100.3164,
        (0, 11.65312625),
        (1.419502217e-2, 3.322257698e-1),
        "rad/s",
        "Gyroscope x",
        clock="device",
        traps=frozenset({"jittered_time", "unit_assumed"}),
    ),
    Row(TRACKER, "tracker", 890, 25, (5.68, 41.24), (36.81932105, 9.153431271), "", "x", traps=UNTIMED | GIVEN),
    Row(
        SHM,
        "lvm",
        51200,
        51200,
        (46.8596458, 47.85962627),
        (0.04641, -0.772429),
        "m/s^2",
        "Acceleration_0",
        traps=FORCED,
    ),
    Row(
        "ladisk__lvm_read/with_comments.lvm",
        "lvm",
        9,
        1.13,
        (0, 9.723275),
        (1.833787, 1.717152),
        "MPa",
        "Pressão ABS.",
        clock="device",
        traps=frozenset({"stale_header", "unit_assumed", "jittered_time", "missing_samples"}),
    ),
    Row(
        TDMS,
        "tdms",
        3500,
        1000,
        (0, 3.499),
        (0, 5.067986572324634),
        "",
        "Amplitude sweep",
        traps=GIVEN | {"stale_header"},
    ),
]

PER_METRE = {"cm": 100.0, "mm": 1000.0, "cm/s": 100.0}


@pytest.mark.parametrize("row", TABLE, ids=lambda row: f"{row.path}:{row.channel}:{row.run}")
def test_a_real_file_is_read_as_it_was_counted(recordings: Path, row: Row) -> None:
    """Family, rate, number of samples, unit, first and last value, traps, and the bytes it came from."""
    path = recordings / row.path
    unit = None if row.unit in PER_METRE else "m"
    recording = open_recording(path, channel=row.channel, run=row.run, rate_hz=row.given_hz, unit=unit)
    samples = recording.samples
    assert sniff(path) == recording.format == row.family
    assert len(samples) == row.samples
    assert recording.info.rate_hz == pytest.approx(row.rate_hz, rel=2e-3 if row.clock == "device" else 1e-9)
    assert (recording.info.clock, recording.info.kind) == (row.clock, "replay")
    np.testing.assert_allclose((samples.t[0], samples.t[-1]), row.t, rtol=1e-9, atol=1e-12)
    tolerance = 6e-6 if row.unit == "cm/s" else 1e-12
    ends = np.array(row.ends) / PER_METRE.get(row.unit, 1.0)
    np.testing.assert_allclose((samples.distance[0], samples.distance[-1]), ends, rtol=1e-12, atol=tolerance)
    assert {trap.code for trap in recording.traps} == row.traps
    assert recording.malformed_rows == 0
    assert recording.originals[0].data == path.read_bytes()
    joined = concatenate(recording.blocks(997))
    assert joined.distance.tobytes() == samples.distance.tobytes()
    stated = {(each.channel, each.unit) for each in inspect(path).surveys}
    assert any(row.channel in (None, name) and unit == row.unit for name, unit in stated)


def test_a_channel_of_volts_is_a_voltage_unless_it_is_counted_as_a_length(recordings: Path) -> None:
    """The file's own unit says what a channel is of; one volt counts as a metre only where the user asks for it."""
    path = recordings / "caspar__PhysicsLab/Q1.txt"
    volts, metres = open_recording(path).samples, open_recording(path, unit="m").samples
    assert (volts.quantity, volts.unit, metres.quantity, metres.unit) == ("voltage", "V", "length", "m")
    assert volts.distance.tobytes() == metres.distance.tobytes()


def test_empty_edges_of_a_derived_column_are_missing_samples(recordings: Path) -> None:
    """One velocity and three accelerations are not there at the end; positions all are."""
    for channel, lost in (("position", 0), ("velocity", 1), ("acceleration", 3)):
        samples = open_recording(recordings / FILO, channel=channel, unit="m").samples
        assert np.flatnonzero(samples.flags & Flag.MISSING.value).tolist() == list(range(11886 - lost, 11886))
