"""The analysis of a recording that still grows: the numbers of its run file, with bounded cost and memory."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

import springmass as sm
from acquisition.block import Block, Flag, SourceInfo
from springmass.loading.options import AnalysisOptions
from springmass.runs.rolling import NotYet, Rolling, live_run
from springmass.runs.run import Run
from storage.run_file.writing import write_run

RATE_HZ = 100.0
INFO = SourceInfo("live", "bench", RATE_HZ, quantum_m=1e-5, clock="device")
SENSOR = {"sensor": {"channel": 0, "family": "line-protocol", "calibration": {"scale": 1.001, "u_scale": 1e-4}}}
FAST = AnalysisOptions(accuracy="fast")


def swing(seconds: float) -> Block:
    """Return a damped swing with noise, missing samples, a gap and false echoes, and the host times of its samples."""
    rng, t = np.random.default_rng(1), np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    y = 0.25 + 0.05 * np.exp(-0.01 * t) * np.cos(8.3 * t + 0.4) + 1e-4 * rng.standard_normal(t.size)
    flags = np.zeros(t.size, np.uint8)
    missing = rng.random(t.size) < 0.05
    y[missing], flags[missing] = np.nan, Flag.MISSING
    y[-500:-494] += 0.005
    flags[-540] |= Flag.GAP_BEFORE
    host_ns = (t * 1e9).astype(np.int64) + rng.integers(1_000_000, 5_000_000, t.size)
    columns = [np.delete(column, np.s_[-600:-540]) for column in (t, y, flags, host_ns)]
    return Block(0, columns[0], columns[1], columns[2], columns[3])


def rolling(most: int | None = None, share: float = 1.0) -> Rolling:
    """Return the rolling analysis of a live sensor on a bench without a scene."""
    return Rolling(lambda block: live_run(block, INFO, None, SENSOR, FAST), share=share, most=most)


@pytest.mark.parametrize("most", [None, 1000])
@pytest.mark.parametrize("size", [1, 999, 2500])
def test_a_live_number_is_that_of_the_run_file(tmp_path: Path, size: int, most: int | None) -> None:
    """Of the same samples with the same times, however they came and whatever came before: to the last digit."""
    whole, live = swing(25.6), rolling(most)
    for start in range(0, len(whole), size):
        live.push(whole[start : start + size])
    run = live.latest()
    assert isinstance(run, Run)
    samples = whole if most is None else whole[-most:]
    path = write_run(tmp_path / "run.h5", [samples], INFO, provenance=SENSOR)
    afterwards = sm.analyse(path, accuracy="fast")
    assert run["T"].n == pytest.approx(2 * np.pi / 8.3, rel=1e-3)
    assert run.result["estimates"] == afterwards.result["estimates"]
    assert [finding.message for finding in run.findings] == [finding.message for finding in afterwards.findings]


def test_it_takes_no_more_than_its_share() -> None:
    """It waits until the time since the last analysis is long enough, and then only for further samples."""
    now_s, analyses = 0.0, 0

    def run_of(block: Block) -> Run:
        nonlocal analyses
        analyses += 1
        return live_run(block, INFO, None, SENSOR, FAST)

    live = Rolling(run_of, share=1e-3, now=lambda: now_s)
    whole = swing(20.0)
    for second in range(10):
        live.push(whole[100 * second : 100 * second + 100])
        live.latest()
    assert analyses == 2  # the first one may have loaded a library
    now_s = 3600.0
    assert live.due()
    assert live.latest() is live.latest()
    now_s = 7200.0
    assert not live.due()
    assert analyses == 3


def test_memory_is_flat_over_an_hour() -> None:
    """360,000 samples pushed allocate no more than the window holds, and leave the last window."""
    held, minute = rolling(1000), swing(60.0)[:5000]
    tracemalloc.start()
    for _ in range(72):
        for start in range(0, 5000, 500):
            held.push(minute[start : start + 500])
    grown, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert grown < 1_000_000  # all samples are 9 MB
    np.testing.assert_array_equal(held.run().loaded.samples.t, minute.t[-1000:])
    np.testing.assert_array_equal(held.run().loaded.samples.distance, minute.distance[-1000:])


NOTHING = np.full(1000, np.nan)
NOT_YET = {
    "fifteen": NOTHING[:15],
    "none": NOTHING[:0],
    "all-missing": NOTHING,
    "still": 0.25 + 1e-4 * np.random.default_rng(5).standard_normal(1000),
    "constant": np.full(1000, 0.25),
    "ramp": np.linspace(0.2, 0.4, 1000),
    "one": np.where(np.arange(1000) == 500, 0.3, np.nan),
    "step": np.where(np.arange(1000) < 990, 0.25, 0.3),
}


@pytest.mark.parametrize("name", NOT_YET)
def test_it_says_why_there_is_no_value_yet(name: str) -> None:
    """Too few samples, no target or a bob at rest give one sentence, no exception and no number."""
    live, y = rolling(), NOT_YET[name]
    live.push(Block(0, np.arange(y.size) / RATE_HZ, y, np.where(np.isnan(y), Flag.MISSING, 0).astype(np.uint8)))
    found = live.latest()
    assert isinstance(found, NotYet) or "T" not in found
    assert found.why
    assert "\n" not in found.why
