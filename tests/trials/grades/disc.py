"""A real disc run from three starts: what the model calls constant must not depend on where the run begins."""

from collections.abc import Iterator
from itertools import combinations

import springmass
from pipeline.numerics.estimate import Estimate
from tests.golden.inputs import RECORDINGS
from tests.trials.grades.graded import Graded, said_of

RUN = RECORDINGS / "AyushPandhi__Pandhi_Ayush_PHY224" / "damped position.txt"
STARTS_S = (None, 20.0, 40.0)
LATER_STARTS_S = (60.0, 80.0)  # for the period of very small swings only
AMPLITUDE_M = 0.025
COEFFICIENTS = ("gamma", "beta")
SMALL = "period_small_swings"
RATE = f"λ at {AMPLITUDE_M * 1e3:g} mm"


def values_from(start_s: float | None) -> tuple[dict[str, Estimate], frozenset[str]]:
    """Return coefficients of linear and quadratic drag, and their damping rate at one amplitude, and the warnings."""
    analysis = springmass.analyse(RUN, from_s=start_s).analysis
    fit = analysis.damping.of_powers(1, 2)
    assert fit is not None
    found = analysis.derived.parameters_of(fit)
    values = {name: found[name] for name in COEFFICIENTS}
    values[RATE] = Estimate.of_variable(found["gamma"].ufloat + found["beta"].ufloat * AMPLITUDE_M, "1/s")
    return values, frozenset(f.code for f in analysis.findings if f.severity != "info")


def apart() -> Iterator[tuple[str, str, float]]:
    """Yield each pair of starts, a quantity, and its difference over the larger u."""
    every = {f"{start_s or 0:g} s": values_from(start_s)[0] for start_s in STARTS_S}
    for first, second in combinations(every, 2):
        for name in every[first]:
            a, b = every[first][name], every[second][name]
            yield f"{first} and {second}", name, (a.value - b.value) / max(a.u, b.u)


def small_swings() -> dict[float, Graded]:
    """Return the period of very small swings by the start of the run; it is missing where the program states none."""
    starts = [start_s or 0.0 for start_s in (*STARTS_S, *LATER_STARTS_S)]
    every = {start_s: said_of(springmass.analyse(RUN, from_s=start_s).analysis).values for start_s in starts}
    return {start_s: each[SMALL] for start_s, each in every.items() if SMALL in each}


def small_swings_apart() -> Iterator[tuple[str, str, float]]:
    """Yield each pair of starts with sound periods of very small swings, and their difference over the larger u."""
    sound = {start_s: x for start_s, x in small_swings().items() if x.sound}
    for (first, a), (second, b) in combinations(sound.items(), 2):
        yield f"{first:g} s and {second:g} s", SMALL, (a.value - b.value) / max(a.u, b.u)
