"""Measure the speed of trajectories as ratios to named references: `python benchmarks/dynamics.py`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from benchmarks.ratios import alternate
from pipeline.dynamics.strang import flow
from pipeline.simulation import Equation, Problem, get_integrator
from pipeline.simulation.halving import auto
from pipeline.simulation.methods import DOP853, SolveIvp

MIXED = Problem(Equation.from_laws(8.66, gamma_per_s=0.0073, beta_per_m_s=0.235), 0.05)
LINEAR = Problem(Equation(angular_frequency_per_s=8.66, gamma_per_s=0.0073), 0.05)
STEP_S, COUNT = 0.01, 12_000


def main() -> int:
    """Print each ratio, its reference and its limit; return 1 if a limit is exceeded."""
    bad = 0
    for name, reference, limit, share, ours, theirs, rounds in cases():
        mine, other = alternate(ours, theirs, rounds)
        ratio = share * mine / other
        bad += ratio > limit
        verdict = "ok" if ratio <= limit else "OVER"
        print(
            f"{verdict:4}  {ratio:7.4f} x  (limit {limit:g}; {1 / ratio:.3g} times faster)  "
            f"{name}: {mine * 1e3:.2f} ms; {reference}: {other * 1e3:.2f} ms"
        )
    for name, error in errors().items():
        print(f"      {error:.2g}  error over the amplitude of {name}")
    return int(bad > 0)


def cases() -> list[tuple[str, str, float, float, Callable[[], object], Callable[[], object], int]]:
    """Return name, reference, limit, share of our time that counts, the two calls, and the number of rounds."""
    strang, exact = get_integrator("strang"), get_integrator("exact")
    a, b, c, d = flow(8.66, 0.0073, STEP_S)
    pulse = np.zeros(COUNT + 1)
    pulse[0] = 0.05
    dop853 = equal_dop853()
    return [
        (
            "Strang, mixed drag, 120 s",
            "solve_ivp DOP853 at about its error",
            0.1,
            1.0,
            lambda: strang.run(MIXED, STEP_S, COUNT),
            lambda: dop853.run(MIXED, STEP_S, COUNT),
            7,
        ),
        (
            "step halving to 1e-6, mixed drag, 120 s",
            "solve_ivp DOP853 at no smaller error",
            0.1,
            1.0,
            lambda: auto(MIXED, STEP_S, COUNT, 1e-6).trajectory,
            lambda: dop853.run(MIXED, STEP_S, COUNT),
            7,
        ),
        (
            "exact propagator, linear, 120 s",
            "scipy lfilter, the same recurrence",
            8.0,
            1.0,
            lambda: exact.run(LINEAR, STEP_S, COUNT),
            lambda: lfilter([1.0, -d], [1.0, -(a + d), a * d - b * c], pulse),
            200,
        ),
    ]


def equal_dop853() -> SolveIvp:
    """Return DOP853 with about the error of Strang splitting, which is no smaller than that of step halving."""
    return replace(DOP853, rtol=1e-9)


def errors() -> dict[str, float]:
    """Return the maximum errors of the compared runs over the amplitude; Strang with step / 64 is the reference."""
    truth = get_integrator("strang").run(MIXED, STEP_S / 64, COUNT * 64, every=64).y
    runs = {
        "strang": get_integrator("strang").run(MIXED, STEP_S, COUNT),
        "auto for 1e-6": auto(MIXED, STEP_S, COUNT, 1e-6).trajectory,
        "DOP853": equal_dop853().run(MIXED, STEP_S, COUNT),
    }
    return {name: float(np.max(np.abs(run.y - truth))) / 0.05 for name, run in runs.items()}


if __name__ == "__main__":
    raise SystemExit(main())
