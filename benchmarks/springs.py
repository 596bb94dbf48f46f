"""Time the comparison of 24 and 100 runs of one spring, two of them exchanged: ``python benchmarks/springs.py``."""

from __future__ import annotations

import math
import time

import numpy as np

from pipeline.bench.spring import oscillating_mass_kg
from pipeline.numerics.estimate import Estimate
from pipeline.several.compare import SpringRun, compare_springs

SPRING_KG = 0.02
STIFFNESS = 15.0


def runs_of(count: int, rng: np.random.Generator) -> list[SpringRun]:
    """Return runs with bobs of 0.1 to 0.4 kg; the masses of the second and the last run are exchanged."""
    typed = np.linspace(0.1, 0.4, count)
    hung = typed.copy()
    hung[[1, -1]] = hung[[-1, 1]]
    return [
        SpringRun(
            f"run{i}",
            Estimate(math.sqrt(STIFFNESS / oscillating_mass_kg(SPRING_KG, true)) * (1 + 1e-4 * rng.normal()), 1e-3),
            Estimate(mass, 2e-5, "kg"),
        )
        for i, (mass, true) in enumerate(zip(typed.tolist(), hung.tolist(), strict=True))
    ]


def main() -> None:
    """Print one line per case: number of runs, seconds, exchanged runs and spring constant."""
    for count in (24, 100):
        runs = runs_of(count, np.random.default_rng(count))
        for spring in (None, Estimate(SPRING_KG, 1e-4, "kg")):
            began = time.perf_counter()
            found = compare_springs(runs, spring_mass_kg=spring)
            took_s = time.perf_counter() - began
            k = found.spring_constant
            known = "unweighed" if spring is None else "weighed"
            print(f"{count} runs, spring {known}: {took_s:.2f} s, exchanged {found.exchanged}, k = {k}")


if __name__ == "__main__":
    main()
