"""The cost of a trajectory: error and time of every integrator on this machine, and the time of ``auto``.

Each time is the minimum of several runs; the time of ``auto`` includes all halvings. Errors are measured against DOP853
at a relative tolerance of 1e-13, or with friction against Strang splitting with a quarter of the shortest measured
step.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any, TypeVar

import numpy as np

from pipeline.dynamics import INTEGRATORS, Equation, Integrator, Problem
from pipeline.dynamics.halving import auto
from pipeline.dynamics.solve_ivp import SolveIvp
from pipeline.dynamics.strang import STRANG
from pipeline.errors import DynamicsError
from pipeline.track import F8
from springmass.runs.simulating.simulation import reference
from springmass.trade.tables import aligned

__all__ = ["SCENES", "Work", "integrators_json", "integrators_text", "measure_integrators", "measure_scene"]

SPACING_S, COUNT = 0.01, 12_000
ROUNDS = 3
PARTS = (1, 2, 4, 8, 16)
TOLERANCES = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
RTOLS = (1e-6, 1e-9, 1e-12)
LONG_RADIANS, LONG_S = 2e4, 1.0  # maximum phase for adaptive methods, rad; maximum time of a repeated run, s
DIVERGED = 1e3  # error over the amplitude above which a solution counts as diverged
SCENES = {
    "linear": Equation.from_laws(8.66, gamma_per_s=0.0073),
    "mixed drag": Equation.from_laws(8.66, gamma_per_s=0.0073, beta_per_m_s=0.235),
    "mixed drag and friction": Equation.from_laws(8.66, gamma_per_s=0.0073, beta_per_m_s=0.235, mu_m_per_s=1e-4),
}
START_M = 0.05
Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Work:
    """One integrator at one setting.

    Parameters
    ----------
    scene : str
    method : str
    setting : str
        Step or tolerance of the method, in words.
    error : float
        Maximum error, divided by the amplitude.
    seconds : float
        Minimum time of the run, s.
    tolerance : float or None
        Tolerance for which ``auto`` chose this method; None if the row is not of ``auto``.
    """

    scene: str
    method: str
    setting: str
    error: float
    seconds: float
    tolerance: float | None = None


def measure_integrators(
    timer: Callable[[], float],
    *,
    count: int = COUNT,
    rounds: int = ROUNDS,
    progress: Callable[[int], None] = lambda _: None,
) -> list[Work]:
    """Measure every scene of :data:`SCENES` as :func:`measure_scene` does; ``progress`` is called after each."""
    rows: list[Work] = []
    for done, (scene, equation) in enumerate(SCENES.items(), 1):
        rows += measure_scene(scene, Problem(equation, START_M), SPACING_S, count, timer, rounds=rounds)
        progress(done)
    return rows


def measure_scene(
    name: str, problem: Problem, spacing_s: float, count: int, timer: Callable[[], float], *, rounds: int = ROUNDS
) -> list[Work]:
    """Measure every integrator on one problem, and ``auto`` at each tolerance with the time of all its halvings.

    Parameters
    ----------
    name : str
        Name of the scene.
    problem : Problem
    spacing_s, count
        Spacing of the samples, s, and their number.
    timer : callable
        Returns the time of a monotonic clock, s.
    rounds : int
        Number of runs, of which the quickest counts; a run of more than a second is not repeated.

    Raises
    ------
    DynamicsError
        If no method solves the problem accurately enough to serve as the reference.
    """
    solutions = []
    for tolerance in TOLERANCES:
        timed = _quickest(partial(auto, problem, spacing_s, count, tolerance), timer, rounds)
        if timed is None:  # out of reach of double precision over this time; so are smaller tolerances
            break
        solutions.append((tolerance, *timed))
    strang_parts = [solution.parts for _, solution, _ in solutions if solution.integrator is STRANG]
    truth = reference(problem, spacing_s, count, max([PARTS[-1], *strang_parts]))[0].y
    size_m = problem.amplitude_m()

    def error_of(y: F8) -> float:
        return float(np.max(np.abs(y - truth))) / size_m if size_m > 0.0 else 0.0

    rows: list[Work] = []
    long = spacing_s * count * problem.equation.angular_frequency_per_s > LONG_RADIANS
    for integrator, parts, setting in _settings(problem, spacing_s):
        if long and isinstance(integrator, SolveIvp):
            continue
        ran = _quickest(partial(integrator.run, problem, spacing_s / parts, count * parts, every=parts), timer, rounds)
        if ran is not None and (error := error_of(ran[0].y)) < DIVERGED:
            rows.append(Work(name, integrator.name, setting, error, ran[1]))
    for tolerance, solution, seconds in solutions:
        setting = f"step {solution.step_s:.3g} s"
        rows.append(Work(name, solution.integrator.name, setting, error_of(solution.trajectory.y), seconds, tolerance))
    return rows


def _settings(problem: Problem, spacing_s: float) -> Iterator[tuple[Integrator, int, str]]:
    """Yield each integrator that can solve the problem, its steps per sample, and its setting in words."""
    for integrator in INTEGRATORS.values():
        if integrator.refusal(problem):
            continue
        if integrator.order:
            yield from ((integrator, parts, f"step {spacing_s / parts:.3g} s") for parts in PARTS)
        elif isinstance(integrator, SolveIvp):
            yield from ((replace(integrator, rtol=rtol), 1, f"rtol {rtol:g}") for rtol in RTOLS)
        else:
            yield integrator, 1, "no step"


def _quickest(run: Callable[[], Result], timer: Callable[[], float], rounds: int) -> tuple[Result, float] | None:
    """Return the result and the minimum time of several runs in s, or None if the method fails."""
    least_s = math.inf
    for _ in range(rounds):
        start = timer()
        try:
            result = run()
        except DynamicsError:
            return None
        least_s = min(least_s, timer() - start)
        if least_s > LONG_S:
            break
    return result, least_s


def recommended(rows: Sequence[Work], tolerance: float) -> Work:
    """Return the quickest measured method whose error is within a tolerance, or else the most accurate one."""
    good = [row for row in rows if row.error <= tolerance]
    return min(good, key=lambda row: row.seconds) if good else min(rows, key=lambda row: row.error)


def integrators_text(rows: Sequence[Work]) -> str:
    """Return one table per scene, with the choices of auto at its end."""
    parts = []
    for scene, group in itertools.groupby(rows, key=lambda row: row.scene):
        table = [["method", "error / amplitude", "time / ms", "setting"]]
        for row in group:
            name = row.method if row.tolerance is None else f"auto {row.tolerance:g}"
            setting = row.setting if row.tolerance is None else f"{row.method}, {row.setting}"
            table.append([name, f"{row.error:.1e}", f"{row.seconds * 1e3:.2f}", setting])
        parts.append("\n".join([scene, *aligned(table)]))
    return "\n\n".join(parts)


def integrators_json(rows: Sequence[Work], version: str) -> dict[str, Any]:
    """Return the measurement as the JSON of ``springmass trade --integrators``."""
    return {"schema": 1, "version": version, "integrators": [asdict(row) for row in rows]}
