"""Several masses on a spring: its constant and its mass, found together.

A few benches are always taken, a hundred with the trials.
"""

import math

import numpy as np
import pytest

from pipeline.analyse import analyse
from pipeline.bench.scene import Scene
from pipeline.numerics.estimate import Estimate
from pipeline.options import options_for
from pipeline.several.compare import SpringRun, compare_springs
from pipeline.several.masses import mass_line
from pipeline.track import Track
from tests.unit.pipeline.several.test_compare import oscillating

U_BOB_KG = 2e-5
LOADS = np.array([0.6, 0.8, 1.0, 1.2, 1.4])  # of five, in masses of the middle one; the spring weighs a tenth of it


def run_of(
    name: str, k: float, spring_kg: float, load_kg: float, typed_kg: float, rng: np.random.Generator
) -> SpringRun:
    """One record of a minute, analysed with the mass that was typed."""
    t = np.arange(6000) / 100.0
    omega = math.sqrt(k / oscillating(spring_kg, load_kg))
    y = 0.3 + 0.04 * np.exp(-0.008 * t) * np.cos(omega * t + rng.uniform(-3, 3))
    scene = Scene(bob_mass_kg=Estimate(typed_kg, U_BOB_KG, "kg"))
    analysis = analyse(Track.from_arrays(t, y + rng.normal(0, 3e-4, t.size)), scene, options_for("standard"))
    return SpringRun.of(name, analysis.derived)


def pulls(seed: int) -> tuple[float, float, float, float]:
    """Return how many u the results of the line, and those of the exact condition, are from the truth."""
    rng = np.random.default_rng([67, seed])
    k, middle_kg = rng.uniform(5.0, 40.0), rng.uniform(0.1, 0.3)
    spring_kg = 0.1 * middle_kg
    loads = middle_kg * LOADS
    typed = loads + rng.normal(0, U_BOB_KG, loads.size)
    runs = [run_of(str(i), k, spring_kg, m, x, rng) for i, (m, x) in enumerate(zip(loads, typed, strict=True))]
    line, exact = mass_line(runs), compare_springs(runs)
    assert line is not None
    return (
        (line.constant.value - k) / line.constant.u,
        (line.effective_mass.value - spring_kg / 3) / line.effective_mass.u,
        (exact.spring_constant.value - k) / exact.spring_constant.u,
        (exact.spring_mass.value - spring_kg) / exact.spring_mass.u,
    )


@pytest.mark.parametrize("benches", [4, pytest.param(100, marks=pytest.mark.trials)])
def test_line_and_exact_condition_give_constant_and_effective_mass(benches: int) -> None:
    """Each lies within two standard uncertainties of the truth in nine of ten benches."""
    found = np.array([pulls(seed) for seed in range(benches)])
    inside = np.count_nonzero(np.abs(found) < 2.0, axis=0)
    assert (inside >= (0.9 * benches if benches >= 100 else benches - 1)).all(), inside
