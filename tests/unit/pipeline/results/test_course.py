"""Many runs of a course: scatter between and within benches, and runs noted wrongly."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.numerics.estimate import Estimate
from pipeline.results.course import CourseRun, agreement, judged


def course(runs: int = 40, seed: int = 0) -> list[CourseRun]:
    """Return good runs of two springs and two discs with the scatter of a bench."""
    rng = np.random.default_rng(seed)
    found = []
    for i in range(runs):
        spring, disc = "AB"[i % 2], ("small", "large")[(i // 2) % 2]
        k = {"A": 14.0, "B": 21.0}[spring]
        found.append(
            CourseRun(
                name=f"run{i}",
                spring=spring,
                disc=disc,
                bench="abcd"[i % 4],
                spring_constant=Estimate(k * (1.0 + 3e-4 * rng.standard_normal()), 3e-4 * k, "N/m"),
                drag=Estimate(2.0 * math.exp(0.03 * rng.standard_normal()), 0.05),
            )
        )
    return found


def test_far_runs_are_named():
    """Runs with another spring, a mass in grams or another disc are suspects."""
    runs = course()
    runs[5] = replace(runs[5], spring_constant=Estimate(14000.0, 1.0, "N/m"))
    runs[16] = replace(runs[16], spring="B")
    runs[21] = replace(runs[21], drag=Estimate(3.0, 0.05))
    assert {one.name for one in judged(runs)[0]} == {"run5", "run16", "run21"}


def test_scatter_within_and_between_is_what_was_put_in():
    """Over 400 benches of 5 runs the moments come back within some percent, and the mean within its uncertainty."""
    rng = np.random.default_rng(3)
    benches = np.repeat(np.arange(400), 5)
    values = 14.0 + 0.05 * rng.standard_normal(400)[benches] + 0.02 * rng.standard_normal(2000)
    found = agreement("k", "", [Estimate(float(x), 0.01, "N/m") for x in values], [str(b) for b in benches])
    assert found.within == pytest.approx(0.02, rel=0.05)
    assert found.between == pytest.approx(0.05, rel=0.1)
    assert abs(found.mean.value - 14.0) < 3.0 * found.mean.u
    assert found.mean.u == pytest.approx(0.05 / 20.0, rel=0.15)
