"""Test on short files, without timing limits, that every ratio of benchmarks/formats.py can be measured."""

from __future__ import annotations

import pytest

from acquisition.recordings.identify import open_recording
from benchmarks import formats


@pytest.mark.trials
def test_every_ratio_can_be_taken(tmp_path):
    """Each reader reads its file in a separate process and returns its time or memory."""
    taken = [(each.name, each.limit, each.take(1)) for each in formats.ratios(tmp_path, 1200, 2500, 300)]
    assert len(taken) == 6
    for name, limit, (ours, theirs) in taken:
        assert ours > 0, name
        assert theirs > 0, name
        assert limit > 0


def test_the_files_it_writes_are_recordings(tmp_path):
    """Reading returns one sample per written row, at the sampling rate of the file."""
    motion = open_recording(formats.write_motion_sensor(tmp_path / "run.txt", 2500))
    assert (motion.format, len(motion.samples), motion.info.rate_hz) == ("motion-sensor", 2500, 100.0)
    lvm = open_recording(formats.write_lvm(tmp_path / "run.lvm", 300), channel="Acceleration_1", unit="m")
    assert (lvm.format, len(lvm.samples), lvm.info.rate_hz) == ("lvm", 300, 51200.0)


def test_reading_a_long_text(benchmark, tmp_path):
    """A hundred thousand rows give a hundred thousand samples, of which none is flagged."""
    path = formats.write_motion_sensor(tmp_path / "run.txt", 100_000)
    recording = benchmark(open_recording, path)
    assert len(recording.samples) == 100_000
    assert not recording.samples.flags.any()
