"""Every ratio of benchmarks/formats.py can be taken; with timing off, over short files."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

from acquisition.recordings.identify import open_recording

FORMATS = Path(__file__).with_name("formats.py")


@pytest.fixture(scope="module")
def bench():
    """The benchmark's module."""
    spec = importlib.util.spec_from_file_location("springmass_bench_formats", FORMATS)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.trials
def test_every_ratio_can_be_taken(bench, tmp_path):
    """Each reader reads its file in a process of its own and tells what it took."""
    taken = [(each.name, each.limit, each.take(1)) for each in bench.ratios(tmp_path, 1200, 2500, 300)]
    assert len(taken) == 6
    for name, limit, (ours, theirs) in taken:
        assert ours > 0, name
        assert theirs > 0, name
        assert limit > 0


def test_the_files_it_writes_are_recordings(bench, tmp_path):
    """Reading gives as many samples as rows were written, at the rate they were written at."""
    motion = open_recording(bench.write_motion_sensor(tmp_path / "run.txt", 2500))
    assert (motion.format, len(motion.samples), motion.info.rate_hz) == ("motion-sensor", 2500, 100.0)
    lvm = open_recording(bench.write_lvm(tmp_path / "run.lvm", 300), channel="Acceleration_1", unit="m")
    assert (lvm.format, len(lvm.samples), lvm.info.rate_hz) == ("lvm", 300, 51200.0)


def test_reading_a_long_text(benchmark, bench, tmp_path):
    """A hundred thousand rows give as many samples, none flagged."""
    path = bench.write_motion_sensor(tmp_path / "run.txt", 100_000)
    recording = benchmark(open_recording, path)
    assert len(recording.samples) == 100_000
    assert not recording.samples.flags.any()
