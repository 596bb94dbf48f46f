"""A stated law: by it alone results are stated, and the recording may contradict it."""

import numpy as np
import pytest

from pipeline.analyse import Analysis, analyse
from pipeline.bench.scene import Scene
from pipeline.numerics.estimate import UpperLimit
from pipeline.track import F8, Track

T = np.arange(6000) / 100.0


def recorded(amplitude: F8, noise_m: float = 3.5e-4, seed: int = 3) -> Track:
    """Return 60 s of an oscillation of this amplitude."""
    noise = noise_m * np.random.default_rng(seed).standard_normal(T.size)
    return Track.from_arrays(T, 0.2 + amplitude * np.cos(8.3 * T) + noise)


def codes_of(analysis: Analysis) -> set[str]:
    """Return the codes of what affects a run's results."""
    return {finding.code for finding in analysis.findings if finding.severity != "info"}


LINEAR = recorded(0.05 * np.exp(-0.0105 * T))


def test_the_law_of_the_scene_is_the_stated_one() -> None:
    """Its coefficients stay out: the rate is that of the recording, by the law alone, and every law is fitted."""
    scene = Scene.from_mapping({"damping": {"law": "linear", "gamma_per_s": 0.9}})
    analysis = analyse(LINEAR, scene)
    damping, derived = analysis.damping, analysis.derived
    assert (damping.selected, damping.admissible, damping.stated) == ("linear", ("linear",), "linear")
    assert derived.law == "linear"
    assert len(damping.fits) > 5
    assert analysis.estimates["damping_rate"].value == pytest.approx(0.0105, rel=0.05)
    assert derived.coefficients["gamma"].value == pytest.approx(analysis.estimates["damping_rate"].value, rel=1e-9)
    assert not codes_of(analysis)


@pytest.mark.parametrize("ratio", [0.0, 0.3, 1.0, 2.0])
def test_an_upper_limit_covers_in_at_least_95_percent(ratio: float) -> None:
    """Of normal estimates of what is not negative it lies above the truth in 95 % or more."""
    values = ratio + np.random.default_rng(7).standard_normal(4000)
    covered = [UpperLimit(value, 1.0).limit >= ratio for value in values.tolist()]
    assert np.mean(covered) >= 0.95 - 3.3 * np.sqrt(0.05 * 0.95 / len(covered))
