"""What a trajectory costs: every integrator's error against its time on this machine, and what ``auto`` takes.

Times are the least of several runs, those of ``auto`` with all halvings. Errors are against DOP853 at a relative
tolerance of 1e-13, with friction against Strang splitting in a quarter of the shortest step that is measured.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.dynamics import INTEGRATORS, Equation, Integrator, Problem
from pipeline.dynamics.halving import Solution, auto
from pipeline.dynamics.solve_ivp import SolveIvp
from pipeline.dynamics.strang import STRANG
from pipeline.errors import DynamicsError
from pipeline.track import F8
from springmass.report.figures.canvas import BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILLION, panels, style
from springmass.runs.simulating.simulation import reference
from springmass.trade.front import Point

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "SCENES",
    "Work",
    "integrators_figure",
    "integrators_json",
    "integrators_text",
    "measure_integrators",
    "measure_scene",
    "recommended",
]

SPACING_S, COUNT = 0.01, 12_000
ROUNDS = 3
PARTS = (1, 2, 4, 8, 16)
TOLERANCES = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
RTOLS = (1e-6, 1e-9, 1e-12)
ROUNDING = 1e-13
LONG_RADIANS, LONG_S = 2e4, 1.0  # of a run that adaptive methods are not put to; of one that is run once
GROWN = 1e3  # times the amplitude: what has grown so far is no solution
SCENES = {
    "linear": Equation.from_laws(8.66, gamma_per_s=0.0073),
    "mixed drag": Equation.from_laws(8.66, gamma_per_s=0.0073, beta_per_m_s=0.235),
    "mixed drag and friction": Equation.from_laws(8.66, gamma_per_s=0.0073, beta_per_m_s=0.235, mu_m_per_s=1e-4),
}
START_M = 0.05
_LOOKS = {
    "forward-euler": (GREY, "o"),
    "symplectic-euler": (SKY, "s"),
    "verlet": (BLUE, "^"),
    "yoshida4": (GREEN, "v"),
    "rk4": (VERMILLION, "D"),
    "exact": ("#000000", "P"),
    "strang": (ORANGE, "o"),
    "lsoda": (GREY, "x"),
    "dop853": (PURPLE, "s"),
}


@dataclass(frozen=True, slots=True)
class Work:
    """One integrator at one setting.

    Parameters
    ----------
    scene : str
    method : str
    setting : str
        Its step or its tolerance.
    error : float
        Largest, over the amplitude.
    seconds : float
        Least time of the run, s.
    tolerance : float or None
        For which ``auto`` took it; None where it was not asked.
    """

    scene: str
    method: str
    setting: str
    error: float
    seconds: float
    tolerance: float | None = None

    @property
    def point(self) -> Point:
        """Time and error as a point of the trade."""
        return Point(self.method, self.seconds, self.error, "tier" if self.tolerance is not None else "reference")


def measure_integrators(
    timer: Callable[[], float],
    *,
    count: int = COUNT,
    rounds: int = ROUNDS,
    progress: Callable[[str], None] | None = None,
) -> list[Work]:
    """Measure every integrator on every scene, and what ``auto`` takes at each tolerance.

    Parameters
    ----------
    timer : callable
        To seconds; the difference of two calls is a time.
    count : int
        Samples of each trajectory, a hundredth of a second apart.
    rounds : int
        Runs of which the quickest counts.
    progress : callable, optional
        Told each scene before it is measured.
    """
    rows: list[Work] = []
    for scene, equation in SCENES.items():
        if progress is not None:
            progress(scene)
        rows += measure_scene(scene, Problem(equation, START_M), SPACING_S, count, timer, rounds=rounds)
    return rows


def measure_scene(
    name: str, problem: Problem, spacing_s: float, count: int, timer: Callable[[], float], *, rounds: int = ROUNDS
) -> list[Work]:
    """Measure every integrator on one problem, and what ``auto`` takes at each tolerance, all halvings included.

    Parameters
    ----------
    name : str
        Of the scene.
    problem : Problem
    spacing_s, count
        Of the samples.
    timer : callable
        To seconds.
    rounds : int
        Runs of which the quickest counts; of what takes more than a second, one.

    Raises
    ------
    DynamicsError
        If nothing solves the problem well enough to measure errors against.
    """
    chosen = list(_chosen(problem, spacing_s, count, timer, rounds))
    finest = max([PARTS[-1], *(solution.parts for _, solution, _ in chosen if solution.integrator is STRANG)])
    truth = reference(problem, spacing_s, count, finest)[0].y
    rows: list[Work] = []
    radians = spacing_s * count * problem.equation.angular_frequency_per_s
    for integrator, parts, setting in _settings(problem, spacing_s):
        if isinstance(integrator, SolveIvp) and radians > LONG_RADIANS:
            continue
        found = _measured(integrator, problem, parts, count, truth, timer, rounds, spacing_s)
        if found is not None and found[0] < GROWN:
            rows.append(Work(name, integrator.name, setting, *found))
    for tolerance, solution, seconds in chosen:
        error = _error(problem, solution.trajectory.y, truth)
        setting = f"step {solution.step_s:.3g} s"
        rows.append(Work(name, solution.integrator.name, setting, error, seconds, tolerance))
    return rows


def recommended(rows: Sequence[Work], tolerance: float) -> Work:
    """Return the cheapest measured way whose error is within a tolerance; the most exact where none is."""
    good = [row for row in rows if row.error <= tolerance]
    return min(good, key=lambda row: row.seconds) if good else min(rows, key=lambda row: row.error)


def integrators_text(rows: Sequence[Work]) -> str:
    """Return the measurement as a table, the choices of auto beneath each scene."""
    lines: list[str] = []
    for scene, group in itertools.groupby(rows, key=lambda row: row.scene):
        lines += ["", scene, "-" * 66]
        lines.append(f"{'method':<18} {'setting':<18} {'error / amplitude':>17} {'time':>10}")
        for row in group:
            name = row.method if row.tolerance is None else f"auto {row.tolerance:g}"
            setting = row.setting if row.tolerance is None else f"{row.method}, {row.setting}"
            lines.append(f"{name:<18} {setting:<26.26} {row.error:>9.1e} {row.seconds * 1e3:>7.2f} ms")
    return "\n".join(lines[1:])


def integrators_json(rows: Sequence[Work], version: str) -> dict[str, Any]:
    """Return the measurement as the JSON of ``springmass trade --integrators``."""
    keys = ("scene", "method", "setting", "error", "seconds", "tolerance")
    return {"schema": 1, "version": version, "integrators": [{key: getattr(row, key) for key in keys} for row in rows]}


def integrators_figure(rows: Sequence[Work], label: str = "time for 120 s at 100 Hz / ms") -> Figure:
    """Draw error against time of every integrator, a panel a scene, and a ring around what auto takes."""
    scenes = list(dict.fromkeys(row.scene for row in rows))
    with style():
        figure, axes = panels([(2.1, 0.3 if i else 0.0) for i in range(len(scenes))], top=0.75)
        times = [row.seconds * 1e3 for row in rows]
        for axis, scene in zip(axes, scenes, strict=True):
            axis.set_xscale("log")
            axis.set_xlim(min(times) / 2.0, max(times) * 2.0)
            axis.set_yscale("log")
            axis.set_title(scene, loc="right", fontsize=8.5, pad=3)
            axis.set_ylabel("error / amplitude")
            for name, (colour, marker) in _LOOKS.items():
                own = [row for row in rows if row.scene == scene and row.method == name and row.tolerance is None]
                drawn = sorted((row.seconds * 1e3, _within(row.error)) for row in own)
                if drawn:
                    x, y = zip(*drawn, strict=True)
                    axis.plot(x, y, marker=marker, color=colour, ms=4.0, lw=0.8, label=name)
            chosen = [row for row in rows if row.scene == scene and row.tolerance is not None]
            for row in chosen:
                assert row.tolerance is not None
                axis.plot([row.seconds * 1e3], [_within(row.error)], "o", ms=9.5, mfc="none", mew=1.2, color="#000000")
            axis.set_ylim(ROUNDING / 100.0, 1e3)
        for axis in axes[:-1]:
            axis.tick_params(labelbottom=False)
        axes[-1].set_xlabel(label)
        known: dict[str, Any] = {}
        for axis in axes:
            for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
                known.setdefault(label, handle)
        from matplotlib.lines import Line2D

        known["taken by auto"] = Line2D([], [], marker="o", ls="", ms=8.0, mfc="none", mew=1.2, color="#000000")
        axes[0].legend(
            known.values(),
            known.keys(),
            loc="lower left",
            bbox_to_anchor=(0.0, 1.08),
            ncols=6,
            markerscale=1.0,
            columnspacing=1.2,
            handlelength=1.6,
            borderaxespad=0.0,
        )
        return figure


def _within(error: float) -> float:
    return min(max(error, ROUNDING / 30.0), 5e2)


def _settings(problem: Problem, spacing_s: float) -> list[tuple[Integrator, int, str]]:
    found: list[tuple[Integrator, int, str]] = []
    for integrator in INTEGRATORS.values():
        if integrator.refusal(problem):  # of another kind of scene
            continue
        if integrator.order:
            found += [(integrator, parts, f"step {spacing_s / parts:.3g} s") for parts in PARTS]
        elif isinstance(integrator, SolveIvp):
            found += [(replace(integrator, rtol=rtol), 1, f"rtol {rtol:g}") for rtol in RTOLS]
        else:
            found.append((integrator, 1, "no step"))
    return found


def _chosen(
    problem: Problem, spacing_s: float, count: int, timer: Callable[[], float], rounds: int
) -> Iterator[tuple[float, Solution, float]]:
    """Yield each tolerance that ``auto`` keeps, its solution, and the least time, s."""
    for tolerance in TOLERANCES:
        least = float("inf")
        try:
            for _ in range(rounds):
                start = timer()
                solution = auto(problem, spacing_s, count, tolerance)
                least = min(least, timer() - start)
                if least > LONG_S:
                    break
        except DynamicsError:
            return  # beyond what double precision reaches in this time; so is any smaller one
        yield tolerance, solution, least


def _measured(
    integrator: Integrator,
    problem: Problem,
    parts: int,
    count: int,
    truth: F8,
    timer: Callable[[], float],
    rounds: int,
    spacing_s: float,
) -> tuple[float, float] | None:
    """Return error and least time; None where the method ran away."""
    least = float("inf")
    for _ in range(rounds):
        start = timer()
        try:
            run = integrator.run(problem, spacing_s / parts, count * parts, every=parts)
        except DynamicsError:
            return None
        least = min(least, timer() - start)
        if least > LONG_S:
            break
    return _error(problem, run.y, truth), least


def _error(problem: Problem, y: F8, truth: F8) -> float:
    size = problem.amplitude_m()
    return float(np.max(np.abs(y - truth))) / size if size > 0.0 else 0.0
