"""Real MotionSensor.vi files: rows, rate, start and values as they were read by eye."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from acquisition.recordings.identify import open_recording, sniff
from acquisition.recordings.tables.table import read_table
from acquisition.recordings.tables.text import Text

PANDHI = "AyushPandhi__Pandhi_Ayush_PHY224"


@dataclass(frozen=True)
class Expected:
    """What a position file holds."""

    path: str
    rows: int
    t0_s: float
    t1_s: float
    first_m: float
    last_m: float
    title: str


POSITIONS = [
    Expected(f"{PANDHI}/position data.txt", 724, 0.43, 7.66, 0.16500, 0.16647, "Sep 20, 2018 1:40 PM"),
    Expected(f"{PANDHI}/damped position.txt", 12172, 0.0, 121.71, 0.25334, 0.20649, "Sep 25, 2018 1:54 PM"),
    Expected("kamjha__PHY224/position_osc.txt", 690, 1.27, 8.16, 0.20985, 0.21006, "Sep 21, 2018 12:30 PM"),
    Expected(
        "pankaj9um__PHY224/undamped_point_data.txt",
        1451,
        5.04,
        19.54,
        0.17797,
        0.17765,
        "Thu, Oct 07, 2021 9:39 AM",
    ),
    Expected(
        "pankaj9um__PHY224/undamped_point_data_set2.txt",
        978,
        0.49,
        10.26,
        0.20688,
        0.21101,
        "Thu, Oct 07, 2021 10:31 AM",
    ),
]

PAIRS = [
    (f"{PANDHI}/position data.txt", f"{PANDHI}/velocity data.txt", 0.00881),
    (f"{PANDHI}/damped position.txt", f"{PANDHI}/damped velocity.txt", 0.31433),
    ("kamjha__PHY224/position_osc.txt", "kamjha__PHY224/velocity_osc.txt", 0.32078),
]


@pytest.mark.parametrize("expected", POSITIONS, ids=lambda each: each.path)
def test_a_position_file(recordings: Path, expected: Expected) -> None:
    """Every row is a sample, on the 100 Hz grid from its own start, and none is flagged."""
    recording = open_recording(recordings / expected.path)
    samples = recording.samples
    assert sniff(recordings / expected.path) == recording.format == "motion-sensor"
    assert len(samples) == expected.rows
    assert (samples.t[0], samples.t[-1]) == (expected.t0_s, expected.t1_s)
    assert (samples.distance[0], samples.distance[-1]) == (expected.first_m, expected.last_m)
    np.testing.assert_array_equal(samples.t, (round(expected.t0_s * 100) + np.arange(expected.rows)) / 100)
    assert not samples.flags.any()
    assert recording.title == f"Motion Sensor Data File {expected.title}"
    info = recording.info
    assert (info.rate_hz, info.clock, info.kind, info.quantum_m) == (100.0, "nominal", "replay", 1e-5)
    assert info.stated_error_m == 0.00239
    assert {trap.code for trap in recording.traps} == {"nominal_clock", "stated_error_is_not_noise"}
    assert recording.malformed_rows == 0
    assert recording.originals[0].data == (recordings / expected.path).read_bytes()


@pytest.mark.parametrize(("position", "velocity", "second"), PAIRS)
def test_a_velocity_file_alone(recordings: Path, position: str, velocity: str, second: float) -> None:
    """Summed up, velocity is the position within its printed digit, but for the offset."""
    alone = open_recording(recordings / velocity)
    there = open_recording(recordings / position).samples.distance
    assert alone.channel == "velocity"
    assert alone.samples.velocity is not None
    assert np.isnan(alone.samples.velocity[0])
    assert alone.samples.velocity[1] == second
    assert alone.samples.distance[0] == 0.0
    assert np.ptp(alone.samples.distance - there) < 1.01e-5
    assert alone.info.quantum_m == pytest.approx(43.0e-6, rel=1e-5)
    assert "offset_unknown" in {trap.code for trap in alone.traps}
    assert not alone.samples.flags.any()


@pytest.mark.parametrize(("position", "velocity", "second"), PAIRS)
def test_a_pair(recordings: Path, position: str, velocity: str, second: float) -> None:
    """Both files of a run join without a hole, and the velocity gives the timer's tick."""
    pair = open_recording(recordings / position, velocity_path=recordings / velocity)
    alone = open_recording(recordings / position)
    assert pair.samples.velocity is not None
    np.testing.assert_array_equal(pair.samples.distance, alone.samples.distance)
    assert pair.samples.velocity[1] == second
    assert pair.info.quantum_m == pytest.approx(43.0e-6, rel=1e-5)
    assert {trap.code for trap in pair.traps} == {"nominal_clock", "stated_error_is_not_noise"}
    assert len(pair.originals) == 2


def test_files_of_two_runs_are_no_pair(recordings: Path) -> None:
    """The velocities of another run are noticed."""
    pair = open_recording(
        recordings / f"{PANDHI}/damped position.txt", velocity_path=recordings / f"{PANDHI}/velocity data.txt"
    )
    assert "pair_mismatch" in {trap.code for trap in pair.traps}


@pytest.mark.parametrize("path", [each.path for each in POSITIONS] + [pair[1] for pair in PAIRS])
def test_every_cell_is_read_as_float_reads_it(recordings: Path, path: str) -> None:
    """Rows that are read together have the very bits that float() gives, cell by cell."""
    lines = (recordings / path).read_text().splitlines()[2:]
    text = Text.of((recordings / path).read_bytes())
    columns = lines[0].count("\t") + 1
    table = read_table(text, range(columns), "\t", width=columns, start=text.head(3)[2].start, first_line=3)
    expected = [[float(cell) for cell in line.split("\t")] for line in lines if line.strip()]
    assert not table.bad.any()
    for column, values in enumerate(table.values):
        np.testing.assert_array_equal(values, [row[column] for row in expected])
