"""Run the benchmarks in a short form, and compare what they count with limits; `make bench` limits the times.

The benchmark of accuracy is not here, because `.ci/trials` and `.ci/nightly` run it with more seeds.
"""

from __future__ import annotations

import math
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from acquisition.recordings.identify import open_recording
from acquisition.recordings.reading import ReadOptions
from benchmarks import course, day, dynamics, formats, page, ports, ratios, recording, trade

Figures = Iterator[tuple[str, float, float, float]]  # name, lowest, measured and highest value
TINY = 1e-12
IMPORT = """
import time
start = time.process_time(); import springmass
middle = time.process_time(); import numpy
print((middle - start) / (time.process_time() - middle))
"""


def imports(_: Path) -> Figures:
    """Importing springmass takes no longer than importing numpy, which it imports too."""
    command = [sys.executable, "-c", IMPORT]
    ratio = min(float(subprocess.run(command, check=True, capture_output=True).stdout) for _ in range(5))
    yield "import springmass / import numpy", 0.0, ratio, 1.0


def samples_of_ports(_: Path) -> Figures:
    """One port at 1 kHz and sixteen at 100 Hz lose no sample, and the log has each line."""
    for count, rate_hz in ((1, 1000.0), (16, 100.0)):
        figures, sent = ports.measure(ports=count, rate_hz=rate_hz, seconds=0.3), round(count * rate_hz * 0.3)
        yield "received", sent, figures.received, sent
        yield "recorded", sent, figures.recorded, sent


def trajectories(_: Path) -> Figures:
    """The compared trajectories have the stated errors, so that their times can be compared."""
    errors = dynamics.errors()
    yield "error of Strang", 0.0, errors["strang"], 1e-6
    yield "error of DOP853", errors["auto for 1e-6"], errors["DOP853"], 1e-6
    _, (halved, dop853), (exact, filtered) = ((ours(), theirs()) for _, _, _, _, ours, theirs, _ in dynamics.cases())
    yield "step halving and DOP853, m", 0.0, abs(halved.y - dop853.y).max(), 0.5e-6
    yield "exact propagator and filter, m", 0.0, abs(exact.y - filtered).max(), 1e-12


def rows_of_files(folder: Path) -> Figures:
    """Each row of the compared files gives a sample, and none is flagged."""
    text = open_recording(formats.write_motion_sensor(folder / "run.txt", 100_000))
    lvm = open_recording(formats.write_lvm(folder / "run.lvm", 300), ReadOptions(channel="Acceleration_1", unit="m"))
    for opened, rows, rate_hz in ((text, 100_000, 100.0), (lvm, 300, 51200.0)):
        yield "usable rows", rows, (opened.samples.flags == 0).sum(), rows
        yield "rate, Hz", rate_hz, opened.info.rate_hz, rate_hz


def sides_of_ratios(folder: Path) -> Figures:
    """Every pair of `make bench` runs; some are programs in strings, which no other check reads."""
    for case in ratios.cases():
        yield case.name, TINY, min(case.times(1)), math.inf
    for ratio in formats.ratios(folder, 1200, 2500, 300):
        yield ratio.name, TINY, min(ratio.take(1)), math.inf


def courses(folder: Path) -> Figures:
    """A course can be measured, and a worker's memory is below its limit."""
    measured = course.measure(6, folder)
    yield "speed of a core", TINY, min(measured.fast, measured.standard, measured.same_answer), math.inf
    yield "efficiency", TINY, measured.efficiency, math.inf
    yield "memory of a worker, MB", measured.half_mb, measured.whole_mb, 250.0


def viewers(_: Path) -> Figures:
    """The page serves two viewers, and a third that was suspended, without delays that a person would notice."""
    measured = page.measure(2.0, 2, 1.0)
    yield "share of a core", 0.0, measured["cpu"], 1.5
    yield "lag of 95 % of the samples, s", measured["p50_s"], measured["p95_s"], 5.0
    yield "delay after a suspension, s", 0.0, measured["current_s"], 5.0


def days(_: Path) -> Figures:
    """The exit code states that memory is constant and every reading recovered; other tests would use memory here."""
    done = subprocess.run([sys.executable, day.__file__, "--hours", "3"], check=False)
    yield "exit code", 0, done.returncode, 0


def recordings(_: Path) -> Figures:
    """No reading is missing; the exit code also depends on the share of a core, which varies in short runs."""
    command = [sys.executable, recording.__file__, "--short", "1", "--long", "2"]
    printed = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False).stdout
    for samples, gaps in re.findall(r"samples: (\d+) in .*, (\d+) gaps", printed):
        yield "samples", 100, int(samples), math.inf
        yield "gaps", 0, int(gaps), 0


def accuracies(_: Path) -> Figures:
    """The standard accuracy stays within a few bounds of the frequency, the classic method is far beyond."""
    rows = trade.measure(trade.MOTION, trade.RecordDefect(), 3)
    yield "error of the standard accuracy, bounds", 0.0, rows["`standard`"][1]["frequency"], 4.0
    yield "error of the classic method, bounds", 100.0, rows["classic lab method"][1]["frequency"], math.inf


SHORT = (imports, samples_of_ports, trajectories, rows_of_files)
LONG = (sides_of_ratios, courses, viewers, days, recordings, accuracies)


@pytest.mark.parametrize("measure", [*SHORT, *(pytest.param(each, marks=pytest.mark.trials) for each in LONG)])
def test_every_figure_lies_between_its_limits(measure: Callable[[Path], Figures], tmp_path: Path) -> None:
    """A benchmark runs, and none of its figures is beyond a limit."""
    figures = list(measure(tmp_path))
    assert figures
    assert [figure for figure in figures if not figure[1] <= figure[2] <= figure[3]] == []
