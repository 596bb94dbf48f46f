"""A stated law, by which alone results are stated, and limits of what is not determined."""

import numpy as np
import pytest

from pipeline.analyse import analyse
from pipeline.bench.scene import Scene
from pipeline.numerics.estimate import UpperLimit
from pipeline.track import Track


def test_the_law_of_the_scene_is_the_stated_one() -> None:
    """Its coefficients stay out: the rate is that of the recording, by the law alone, and every law is fitted."""
    scene = Scene.from_mapping({"damping": {"law": "linear", "gamma_per_s": 0.9}})
    t = np.arange(6000) / 100.0
    y = 0.2 + 0.05 * np.exp(-0.0105 * t) * np.cos(8.3 * t) + 3.5e-4 * np.random.default_rng(3).standard_normal(t.size)
    analysis = analyse(Track.from_arrays(t, y), scene)
    damping, derived = analysis.damping, analysis.derived
    assert (damping.selected, damping.admissible, damping.stated) == ("linear", ("linear",), "linear")
    assert derived.law == "linear"
    assert len(damping.fits) > 5
    assert analysis.estimates["damping_rate"].value == pytest.approx(0.0105, rel=0.05)
    assert derived.coefficients["gamma"].value == pytest.approx(analysis.estimates["damping_rate"].value, rel=1e-9)
    assert {finding.severity for finding in analysis.findings} <= {"info"}


@pytest.mark.parametrize("ratio", [0.0, 0.3, 1.0, 2.0])
def test_an_upper_limit_covers_in_at_least_95_percent(ratio: float) -> None:
    """Of normal estimates of what is not negative it lies above the truth in 95 % or more."""
    values = ratio + np.random.default_rng(7).standard_normal(4000)
    covered = [UpperLimit(value, 1.0).limit >= ratio for value in values.tolist()]
    assert np.mean(covered) >= 0.95 - 3.3 * np.sqrt(0.05 * 0.95 / len(covered))
