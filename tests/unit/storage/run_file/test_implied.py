"""Columns that a formula gives: never another value than the one written, whatever becomes of the array."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.block import Block
from acquisition.recordings.sampling.nominal import Grid
from acquisition.source import SourceInfo
from storage.errors import RunDamaged
from storage.run_file.implied import rule_for, values_of
from storage.run_file.layout import CHUNK
from storage.run_file.reading import open_run
from storage.run_file.writing import write_run


def write(path: Path, t: np.ndarray, flags: np.ndarray, rate_hz: float = 100.0) -> Path:
    """Write a run of these times and flags, in blocks of 1000."""
    whole = Block(0, t, np.full(t.size, 0.25), flags)
    blocks = (whole[start : start + 1000] for start in range(0, t.size, 1000))
    return write_run(path, blocks, SourceInfo("replay", "run.txt", rate_hz))


def implied(path: Path) -> set[str]:
    """Return the columns that a file's header has a formula for."""
    with h5py.File(path) as file:
        return set(json.loads(file["/entry/provenance/header"][()])["implied"])


@pytest.mark.parametrize(("first", "rate_hz"), [(0, 100.0), (43, 60.0), (-7, 125.0), (10**9, 51200.0)])
def test_times_of_a_nominal_clock_are_calculated_bit_for_bit(tmp_path: Path, first: int, rate_hz: float) -> None:
    """Row numbers over a rate, from any row on and over many chunks, come back as they were."""
    t = np.arange(first, first + 2 * CHUNK + 11) / rate_hz
    path = write(tmp_path / "run.h5", t, np.zeros(t.size, np.uint8), rate_hz)
    assert implied(path) == {"time", "quality"}
    with open_run(path) as run:
        calculated, read = run.samples(digests=False), run.samples()
        assert calculated.t.tobytes() == read.t.tobytes() == t.tobytes()
        assert calculated.flags.tobytes() == read.flags.tobytes()
        assert (calculated.t.dtype, calculated.flags.dtype) == (read.t.dtype, read.flags.dtype)
        run.check(calculated)
        run.verify()


@pytest.mark.parametrize("row", [0, 1, 999, CHUNK, CHUNK + 4])
def test_one_value_off_its_formula_is_read_from_the_file(tmp_path: Path, row: int) -> None:
    """A time by one last bit and a single flag, wherever they stand, leave nothing to calculate."""
    t = np.arange(1, CHUNK + 6) / 100
    t[row] = np.nextafter(t[row], np.inf)
    flags = np.zeros(t.size, np.uint8)
    flags[-1 - row] = 1
    path = write(tmp_path / "run.h5", t, flags)
    assert implied(path) == set()
    with open_run(path) as run:
        samples = run.samples(digests=False)
    assert (samples.t.tobytes(), samples.flags.tobytes()) == (t.tobytes(), flags.tobytes())


def test_a_rewritten_array_of_times_changes_nothing_that_is_calculated(tmp_path: Path) -> None:
    """What is calculated is what was written; what reads the array finds that it is another."""
    t = np.arange(500) / 100
    path = write(tmp_path / "run.h5", t, np.zeros(500, np.uint8))
    with h5py.File(path, "r+") as file:
        file["/entry/signal/time"][7] = 9.0
    with open_run(path) as run:
        assert run.samples(digests=False).t.tobytes() == t.tobytes()
        with pytest.raises(RunDamaged, match="'time'"):
            run.samples()
        with pytest.raises(RunDamaged, match="'time'"):
            run.verify()


@given(
    first=st.integers(-(10**6), 10**6),
    rate_hz=st.floats(0.01, 1e6),
    origin_s=st.sampled_from([0.0, 0.1, 46.8596458, -3.7]),
    size=st.integers(1, 200),
)
def test_a_rule_gives_what_it_was_told_from(first: int, rate_hz: float, origin_s: float, size: int) -> None:
    """A rule is only ever returned where it gives the very values, and -0.0 is not 0.0."""
    t = origin_s + np.arange(first, first + size) / rate_hz
    rule = rule_for("time", t, rate_hz)
    if rule is not None:
        assert values_of(rule, 0, size, t.dtype).tobytes() == t.tobytes()
    negative_zero = np.array([-0.0])
    rule = rule_for("time", negative_zero, rate_hz)
    assert rule is None or values_of(rule, 0, 1, t.dtype).tobytes() == negative_zero.tobytes()


@pytest.mark.parametrize("size", [0, 1, 16384, 16385, 40_000])
@pytest.mark.parametrize("grid", [Grid(100.0), Grid(59.94, 46.8596458), Grid(3.0, -1e-3)])
@pytest.mark.parametrize("first", [-7, 0, 123_456_789])
def test_times_filled_in_place_are_those_of_their_indices(grid: Grid, first: int, size: int) -> None:
    """Bit for bit, within one piece and across several."""
    out = np.full(size, np.nan)
    grid.fill(first, out)
    assert out.tobytes() == np.asarray(grid.time(np.arange(first, first + size))).tobytes()
