"""Five masses on a spring that weighs a tenth of the middle one: its constant and its effective mass.

A few benches are always taken, a hundred with the trials.
"""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.results.compare import compare_springs
from pipeline.results.masses import mass_line
from tests.trials.test_springs import U_BOB_KG, run_of

LOADS = np.array([0.6, 0.8, 1.0, 1.2, 1.4])


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


@pytest.mark.parametrize("benches", [8, pytest.param(100, marks=pytest.mark.trials)])
def test_line_and_exact_condition_give_constant_and_effective_mass(benches: int) -> None:
    """Each lies within two standard uncertainties of the truth in nine of ten benches."""
    found = np.array([pulls(seed) for seed in range(benches)])
    inside = np.count_nonzero(np.abs(found) < 2.0, axis=0)
    assert (inside >= (0.9 * benches if benches >= 100 else benches - 2)).all(), inside
