"""Clipping: crests are left out by the motion that the middle of the swing shows, and no others."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.analyse import Analysis, analyse
from pipeline.track import F8, Quality, Track

SIGMA_M = 3e-4
PERIOD_S = 0.7253


def swing(rng: np.random.Generator, *, seconds: float = 20.0, fall: float = 0.012) -> tuple[F8, F8]:
    """Return times and the motion about rest of a bob of 50 mm, m, without noise."""
    t = np.arange(round(100 * seconds)) / 100.0
    return t, 0.05 * np.exp(-fall * t) * np.cos(8.3 * t + rng.uniform(-math.pi, math.pi))


def seen(t: F8, x: F8, rng: np.random.Generator) -> Analysis:
    """Analyse a motion about 0.3 m with noise."""
    return analyse(Track.from_arrays(t, 0.3 + x + SIGMA_M * rng.standard_normal(t.size)))


def codes(found: Analysis) -> set[str]:
    """Return the codes of the warnings."""
    return {finding.code for finding in found.findings if finding.severity != "info"}


def report_twin(seed: int) -> Track:
    """Return a twin of a lab report's undamped recording, every far crest of which a fixed object's echo cuts off.

    5.1 s at 100 Hz, 71.4 mm, noise of 0.069 mm. Plateaus lie from 31.97 to 32.25 cm, level to 0.1 mm or flipping
    between two levels within a crest, a quarter of every period long; the ramps are smoothed over three samples.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(510) / 100.0
    angle = 2.0 * math.pi * t / PERIOD_S + rng.uniform(0.0, 2.0 * math.pi)
    rest_m = 0.3211 - 0.0714 * math.cos(math.pi / 4.0)
    motion = rest_m + 0.0714 * np.cos(angle)
    crest = np.round(angle / (2.0 * math.pi)).astype(int)
    levels = rng.uniform(0.3197, 0.3225, (crest.max() + 1, 2))
    flips = rng.random(crest.max() + 1) < 0.5
    second = rng.random(t.size) < 0.5
    plateau = np.where(second & flips[crest], levels[crest, 1], levels[crest, 0])
    cut = motion > plateau
    y = np.where(cut, plateau + 0.03e-3 * rng.standard_normal(t.size), motion + 0.069e-3 * rng.standard_normal(t.size))
    ramp = np.convolve(np.abs(np.diff(cut.astype(float), prepend=float(cut[0]))), np.ones(3), "same") > 0
    y[1:-1] = np.where(ramp, np.convolve(y, [0.25, 0.5, 0.25], "same"), y)[1:-1]
    return Track.from_arrays(t, y)


def test_twins_of_a_reports_recording() -> None:
    """Without a single far crest the amplitude is right within 2 u, nine times in ten, and within 0.1 mm always."""
    twins = [analyse(report_twin(seed)) for seed in range(10)]
    errors = np.array([found.estimates["amplitude"].value - 0.0714 for found in twins])
    u = np.array([found.estimates["amplitude"].u for found in twins])
    assert np.abs(errors).max() < 0.1e-3
    assert np.count_nonzero(np.abs(errors) > 2.0 * u) <= 1
    assert np.sqrt(np.mean((errors / u) ** 2)) < 1.3
    for found in twins:
        assert found.estimates["noise"].value == pytest.approx(0.069e-3, rel=0.25)
        assert found.estimates["period"].value == pytest.approx(PERIOD_S, abs=1e-4)
        assert 0.2 * 510 < found.quality["clipped"] < 0.4 * 510
        assert "clipped" in codes(found)


@pytest.mark.parametrize("shape", ["wandering", "rounded"])
def test_both_ends(shape: str) -> None:
    """Plateaus at both ends that wander or still rise leave amplitude and offset right,."""
    rng = np.random.default_rng(5)
    t, x = swing(rng)
    level = 0.04 + (1e-3 * rng.uniform(-1, 1, 27)[(8.3 * t / (2 * math.pi)).astype(int)] if shape == "wandering" else 0)
    beyond = np.abs(x) - level
    rise = 1.5e-3 * np.tanh(np.maximum(beyond, 0.0) / 4.5e-3) if shape == "rounded" else 0.0
    found = seen(t, np.where(beyond > 0, np.sign(x) * (level + rise), x), rng)
    for name, true in (("amplitude", 0.05), ("offset", 0.3)):
        assert abs(found.estimates[name].value - true) < 3.0 * found.estimates[name].u
    assert "clipped" in codes(found)


def test_object_that_is_taken_away() -> None:
    """Crests after the object is gone are used."""
    rng = np.random.default_rng(6)
    t, x = swing(rng)
    found = seen(t, np.where((x > 0.035) & (t < 5.0), 0.035, x), rng)
    flagged = (found.flags & np.uint8(Quality.CLIPPED)) != 0
    assert flagged[(x > 0.036) & (t < 5.0)].all()
    assert not flagged[t >= 5.0].any()
    assert abs(found.estimates["amplitude"].value - 0.05) < 3.0 * found.estimates["amplitude"].u


@pytest.mark.parametrize("how", ["detour", "image", "slow"])
def test_echo_that_moves_with_the_bob(how: str) -> None:
    """What moves with the bob near one end is named, as a cut or as no sinusoid, and the amplitude is covered."""
    rng = np.random.default_rng(7)
    t, x = swing(rng)
    echo = {"detour": x + 0.004, "image": 0.07 - x, "slow": 0.0175 + 0.5 * x}[how]
    found = seen(t, np.where(x > 0.035, echo, x), rng)
    assert codes(found) & {"clipped", "not_sinusoidal"}
    assert abs(found.estimates["amplitude"].value - 0.05) < 4.0 * found.estimates["amplitude"].u


def test_clusters_of_echoes_at_some_turning_points_are_no_cut() -> None:
    """Where half the crests carry a cluster of echoes and half none, nothing is cut."""
    rng = np.random.default_rng(8)
    t, x = swing(rng)
    struck = np.isin((8.3 * t / (2 * math.pi)).astype(int) % 4, (1, 2))
    found = seen(t, np.where((x < -0.042) & struck, x + 0.006, x), rng)
    assert found.quality["clipped"] == 0
    assert found.quality["false_echo"] > 50


@pytest.mark.parametrize("shape", ["bent", "triangle"])
def test_a_motion_that_is_no_sinusoid_is_not_cut(shape: str) -> None:
    """A scale that bends the motion everywhere, and a triangle, are not made sinusoids by leaving their ends out."""
    rng = np.random.default_rng(9)
    t, x = swing(rng)
    other = {"bent": x + 0.05 * x**2 / 0.05, "triangle": 0.05 * 2.0 / math.pi * np.arcsin(x / 0.05)}[shape]
    assert seen(t, other, rng).quality["clipped"] == 0
