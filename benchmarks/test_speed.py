"""Test the benchmarked calls without timing limits: they must run and give the expected results."""

from __future__ import annotations

import pytest

from benchmarks import ratios
from pipeline.analyse import analyse
from springmass import load, sample_data
from springmass.loading.scenes import read_scene


@pytest.fixture(scope="module")
def damped():
    """Return the bundled damped recording and its scene."""
    data = sample_data()
    return load(data / "damped_simulated_position.txt").loaded.track, read_scene(data / "damped.scene.toml")


def test_reading_a_text_recording(benchmark):
    """Reading 12,000 rows of text gives 12,000 samples."""
    loaded = benchmark(load, sample_data() / "damped_simulated_position.txt")
    assert len(loaded.loaded.track) == 12000


def test_the_whole_analysis(benchmark, damped):
    """The analysis at standard accuracy selects the law with which the record was simulated."""
    result = benchmark(analyse, *damped)
    assert result.motion.damping.selected == "linear+quadratic"


@pytest.mark.trials
def test_every_ratio_can_be_taken():
    """Each pair of the ratio table runs, so that `make bench` keeps working."""
    for case in ratios.cases():
        mine, other = case.times(1)
        assert mine > 0, case.name
        assert other > 0, case.reference
        assert case.limit > 0
