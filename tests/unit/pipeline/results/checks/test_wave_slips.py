"""Whole-wave slips of a 40 kHz sensor have a code of their own, and nothing else has it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.analyse import analyse
from pipeline.numerics.estimate import Estimate
from pipeline.results.checks.finding import Finding
from pipeline.track import Track

WAVE_M, PERIOD_S = 0.0043, 0.79


def findings_of(off_m: np.ndarray, noise_m: float = 1e-4, **known: float) -> tuple[dict[str, Finding], Estimate]:
    """Return the findings by their code, and the period, of a bob some of whose samples are off by so much."""
    t = np.arange(off_m.size) / 100.0
    noise = noise_m * np.random.default_rng(5).standard_normal(t.size)
    y = 0.35 + 0.05 * np.exp(-0.01 * t) * np.cos(2.0 * np.pi * t / PERIOD_S) + noise + off_m
    found = analyse(replace(Track.from_arrays(t, y), **known))
    return {finding.code: finding for finding in found.findings}, found.estimates["period"]


def slips(count: int, size: int = 6000, wave_m: float = WAVE_M) -> np.ndarray:
    """Return how far off samples are, of which so many slipped to either side in turn."""
    off_m = np.zeros(size)
    rows = np.random.default_rng(6).choice(size, count, replace=False)
    off_m[rows] = wave_m * np.where(np.arange(count) % 2, 1.0, -1.0)
    return off_m


@pytest.mark.parametrize("noise_m", [8e-5, 3e-4, 5e-4])
def test_slips_are_counted_by_side_and_told_once(noise_m: float) -> None:
    """One sample in a hundred: at least 99 in 100 are told, none of them as a false echo too; T is right."""
    found, period = findings_of(slips(60), noise_m)
    told = found["wave_slips"].message
    count, nearer = int(told.split()[0]), int(told.partition(" of them nearer")[0].split()[-1])
    assert 60 >= count >= 59
    assert 29 <= nearer <= 30
    assert found["wave_slips"].severity == "info"
    if others := found.get("false_echoes"):  # noise, and what stands beside a slip
        assert int(others.message.split()[0]) <= 30
    assert abs(period.value - PERIOD_S) <= 3.0 * period.u


def test_many_slips_are_a_warning() -> None:
    """From a tenth of the samples on."""
    found, _ = findings_of(slips(800))
    assert found["wave_slips"].severity == "warning"


def test_the_wave_is_as_long_as_the_sound_that_made_the_distances() -> None:
    """In helium, 970 m/s, a wave is 12 mm."""
    found, _ = findings_of(slips(60, wave_m=0.0121), speed_of_sound_m_per_s=970.0)
    assert "(12.1 mm)" in found["wave_slips"].message
    found, _ = findings_of(slips(60, wave_m=0.0121))
    assert "wave_slips" not in found
    assert 60 <= int(found["false_echoes"].message.split()[0]) <= 66


def test_an_object_that_the_bob_passes_is_no_slip() -> None:
    """Eleven samples in a row by chance a wave off, beside clusters that are not: one moment of three."""
    off_m = np.zeros(2500)
    for start, samples, size_m in ((37, 5, 3.5e-3), (1854, 11, 4.6e-3), (1930, 12, 5.1e-3)):
        off_m[start : start + samples] = size_m
    assert "wave_slips" not in findings_of(off_m, 8e-5)[0]


def test_false_echoes_anywhere_are_no_slips() -> None:
    """Spread evenly about the motion, some of them lie a wave off by chance; two alone tell nothing."""
    off_m = slips(120)
    off_m[off_m != 0.0] = np.random.default_rng(7).uniform(-8.6e-3, 8.6e-3, 120)
    assert "wave_slips" not in findings_of(off_m)[0]
    assert "wave_slips" not in findings_of(slips(2))[0]


def test_noise_hides_slips_and_is_none() -> None:
    """A sensor of 1.1 mm, whose outliers by four standard deviations lie a wave off."""
    assert "wave_slips" not in findings_of(np.zeros(6000), noise_m=1.1e-3)[0]


def test_echoes_in_clusters_are_no_slips() -> None:
    """The bundled recording has clusters of echoes of 2.5 to 7.5 mm, more of them about a wave off than by chance."""
    rng = np.random.default_rng(8)
    off_m = np.zeros(12_000)
    for at, length, size in zip(
        rng.choice(11_900, 45), rng.integers(3, 18, 45), rng.uniform(2.5, 7.5, 45), strict=True
    ):
        off_m[at : at + length] = 1e-3 * size
    off_m[rng.choice(12_000, 110)] = rng.uniform(-8.6e-3, 8.6e-3, 110)
    found, _ = findings_of(off_m)
    assert "wave_slips" not in found
    assert "false_echoes" in found
    slipped = np.where(slips(120, 12_000) != 0.0, slips(120, 12_000), off_m)
    assert 110 <= int(findings_of(slipped)[0]["wave_slips"].message.split()[0]) <= 300
