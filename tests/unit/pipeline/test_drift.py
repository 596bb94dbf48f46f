"""The mean of (estimate - truth)/u over many records: what no single record shows, a slow drift of a number."""

import numpy as np
import pytest

from pipeline.analyse import analyse
from pipeline.bench.scene import Scene
from pipeline.track import Track
from tests.synthetic import LAW_TRUTHS, Truth, noisy, times

MASS_KG, SPRING_KG = 0.2, 0.01
SCENE = Scene.from_mapping(
    {"bob": {"mass_kg": {"value": MASS_KG, "u": 1e-5}}, "spring": {"mass_kg": {"value": SPRING_KG, "u": 1e-5}}}
)
SECONDS, NOISE_M, PAIRS = 10.0, 3e-4, 12
MOST = 0.15
"""A drift by 0.3 u lies at least four standard errors of the mean beyond it, whatever its sign."""


@pytest.mark.parametrize("law", ["linear", "linear+quadratic"])
def test_no_number_drifts_by_a_fraction_of_its_uncertainty(law: str) -> None:
    """Each noise counts with both signs, so that it cancels in the mean to first order, and a bias remains."""
    pulls: dict[str, list[float]] = {}
    for seed in range(PAIRS):
        truth = Truth(phase=float(np.random.default_rng(seed).uniform(-np.pi, np.pi)), **LAW_TRUTHS[law])
        true = {
            "period": truth.period,
            "amplitude": truth.amplitude,
            "damping_rate": truth.gamma + truth.beta * truth.amplitude,
            # The mean square of the damping rate adds less than 4 ppm to omega^2.
            "spring_constant": truth.omega**2 * (MASS_KG + SPRING_KG / 3 + SPRING_KG**2 / (45 * MASS_KG)),
        }
        for sign in (1.0, -1.0):
            t = times(SECONDS)
            found = analyse(Track.from_arrays(t, noisy(truth, t, sign * NOISE_M, seed)), SCENE).estimates
            for name, value in true.items():
                pulls.setdefault(name, []).append((found[name].value - value) / found[name].u)
    means = {name: float(np.mean(each)) for name, each in pulls.items()}
    assert max(map(abs, means.values())) < MOST, means
