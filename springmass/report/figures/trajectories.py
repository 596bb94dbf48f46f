"""Figures of a simulation: forward and symplectic Euler as in the lab report, with the exact solution.

Position, velocity, energy and phase plot of both methods with the step of the run, the error of each against time, and
a measured run with its prediction.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.dynamics import Trajectory, get_integrator
from pipeline.dynamics.band import Band
from pipeline.dynamics.halving import auto
from pipeline.errors import DynamicsError
from pipeline.track import F8
from springmass.report.figures.canvas import BLUE, GREEN, GREY, ORANGE, VERMILLION, legend_above, panels, style, thinned
from springmass.runs.simulating.simulation import Against, Simulation

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["EULERS", "against_figure", "band_figure", "draw_simulation"]

EULERS = (("forward-euler", "forward Euler", VERMILLION), ("symplectic-euler", "symplectic Euler", BLUE))
PERIODS, TURNS = 14, 6  # periods in the detail of a long run; turns in a phase plot
POINTS = 1500
GROWN = 1e6  # multiple of the starting amplitude above which curves are cut off
DASHED: dict[str, Any] = {"color": "#000000", "lw": 0.9, "ls": (0, (2, 1.5))}  # for exact and predicted curves
_EXACT: dict[str, Any] = {**DASHED, "lw": 0.6}
ROUGH, EXACT = 1e-3, 1e-9  # errors over the amplitude: one that is visible, and one that is called exact
BINS = 250  # of a dense series; the minimum and maximum of each bin are drawn


def draw_simulation(simulation: Simulation, mass_kg: float | None) -> dict[str, Figure]:
    """Return every figure of a simulation by name.

    Parameters
    ----------
    simulation : Simulation
    mass_kg : float or None
        Mass for the energy; without it, the energy of one kilogram is drawn.
    """
    beside = _beside(simulation)
    runs = [_euler(simulation, beside, name) for name, *_ in EULERS]
    with style():
        return {
            "position": _against_time(simulation, beside, runs, "y", 1e3, "displacement / mm"),
            "velocity": _against_time(simulation, beside, runs, "v", 1.0, "velocity / (m/s)"),
            "energy": _energy(beside, runs, mass_kg),
            "phase": _phase(simulation, beside, runs),
            "error": _error(simulation, beside, runs),
        }


def against_figure(against: Against) -> Figure:
    """Draw a measured run with the prediction and its band, and below it the residuals.

    Parameters
    ----------
    against : Against
    """
    with style():
        figure, (above, below) = panels([2.6, 1.6])
        below.sharex(above)
        dense: dict[str, Any] = {"rasterized": against.t.size > POINTS}
        if against.band is not None:
            _shade(above, against.t, against.predicted + against.band)
        above.plot(against.t, against.measured * 1e3, ".", ms=2.2, mew=0, color=GREY, label="measured", **dense)
        above.plot(against.t, against.predicted * 1e3, color="#000000", lw=0.6, label="predicted", **dense)
        above.set_ylabel("distance / mm")
        above.tick_params(labelbottom=False)
        legend_above(above, 4)
        if against.band is not None:
            _shade(below, against.t, against.band)
        left = (against.measured - against.predicted) * 1e3
        below.plot(against.t, left, ".", ms=1.8, mew=0, color=BLUE, **dense)
        below.axhline(0.0, color="#000000", lw=0.8)
        below.set_ylabel("residual / mm")
        below.set_xlabel("time / s")
        below.set_xlim(float(against.t[0]), float(against.t[-1]))
        return figure


def band_figure(simulation: Simulation, band: Band) -> Figure:
    """Draw motion, amplitude and phase with the band from the scene's uncertainties, and below them only the band.

    Parameters
    ----------
    simulation : Simulation
    band : Band
        Band that covers at least the simulated time.
    """
    end = float(simulation.trajectory.t[-1])
    # The motion is drawn for the last periods, where the grid is fine enough; amplitude and band for the whole run.
    last: F8 = np.linspace(max(0.0, end - PERIODS * _periods(simulation)), end, POINTS)
    whole = band.t[band.t <= end]
    amplitude, of_amplitude = band.amplitude_at(whole)
    with style():
        figure, (motion, course, turn, width) = panels([2.0, 1.6, 1.6, 1.8])
        middle = simulation.trajectory.at(last)
        _shade(motion, last, middle + band.displacement_at(last))
        motion.plot(last, middle * 1e3, color="#000000", lw=0.8, label="the scene's values")
        motion.set_ylabel("displacement / mm")
        legend_above(motion)
        _shade(course, whole, of_amplitude)
        course.plot(whole, amplitude * 1e3, color="#000000", lw=0.8)
        course.set_ylabel("amplitude / mm")
        _shade(turn, whole, band.phase_at(whole), 1.0)
        turn.set_ylabel("phase / rad")
        _shade(width, whole, band.displacement_at(whole))
        width.set_ylabel("band / mm")
        width.set_xlabel("time / s")
        for panel, t in ((motion, last), (course, whole), (turn, whole), (width, whole)):
            panel.set_xlim(float(t[0]), float(t[-1]) if t[-1] > t[0] else float(t[0]) + 1.0)
        return figure


def _shade(panel: Axes, t: F8, levels: F8, factor: float = 1e3) -> None:
    """Fill between the quantiles (4, n) of the 95 % and 68 % bands, converted from m to mm by default."""
    for low, high, share, alpha in ((0, 3, 95, 0.25), (1, 2, 68, 0.45)):
        look: dict[str, Any] = {"color": ORANGE, "alpha": alpha, "lw": 0.0, "rasterized": t.size > POINTS}
        panel.fill_between(t, levels[low] * factor, levels[high] * factor, label=f"{share} %", **look)


@dataclass(frozen=True, slots=True)
class _Beside:
    """The trajectory with which both Euler methods are compared, and its name in a legend."""

    run: Trajectory
    words: str


def _beside(simulation: Simulation) -> _Beside:
    """Return the reference if the error was measured, else the run, or auto's solution if the run is inaccurate."""
    if simulation.check is not None:
        return _Beside(simulation.check.reference, "exact")
    run, error = simulation.trajectory, simulation.solution.error
    if error is None or not error <= ROUGH:
        found = auto(simulation.problem, run.spacing_s, len(run.y) - 1, ROUGH)
        run, error = found.trajectory, found.error
    assert error is not None
    return _Beside(run, "exact" if error < EXACT else f"solved to {error:.0e}")


def _euler(simulation: Simulation, beside: _Beside, name: str) -> Trajectory:
    """Run a method with the run's spacing; if it diverges, halve the duration until it can be solved."""
    spacing, count = beside.run.spacing_s, len(beside.run.y) - 1
    while True:
        try:
            return get_integrator(name).run(simulation.problem, spacing, count)
        except DynamicsError:
            if count < 2:
                raise
            count //= 2


def _periods(simulation: Simulation) -> float:
    return float(2.0 * math.pi / simulation.problem.equation.angular_frequency_per_s)


def _shown(simulation: Simulation, run: Trajectory, periods: int) -> slice:
    """Return the rows of the first periods, at least two rows."""
    return slice(0, min(len(run.y), max(2, int(periods * _periods(simulation) / run.spacing_s) + 1)))


def _pair(height: float, labels: tuple[str, str], rows: int = 1) -> tuple[Figure, list[Axes]]:
    """Make rows of two panels side by side, one for each method."""
    figure, axes = panels([height] * rows, columns=len(EULERS))
    for panel in axes[:: len(EULERS)]:
        panel.set_ylabel(labels[1])
    for panel in axes[-len(EULERS) :]:
        panel.set_xlabel(labels[0])
    return figure, axes


def _against_time(
    simulation: Simulation, beside: _Beside, runs: Sequence[Trajectory], what: str, factor: float, label: str
) -> Figure:
    """Draw the whole run and, if it is long, its first periods below."""
    long = any(len(run.y) > _shown(simulation, run, PERIODS).stop for run in runs)
    figure, axes = _pair(2.3 if long else 3.1, ("time / s", label), 2 if long else 1)
    for panel, run, (_, words, colour) in zip(axes[:2], runs, EULERS, strict=True):
        for of, look in (
            (run, {"color": colour, "lw": 1.0, "label": words}),
            (beside.run, {**_EXACT, "label": beside.words}),
        ):
            value = getattr(of, what)[: len(run.y)] * factor
            rows = thinned(value, BINS)
            panel.plot(run.t[rows], value[rows], **look)
        panel.set_xlim(float(run.t[0]), float(run.t[-1]))
        legend_above(panel, 2)
    for panel, run, (_, _, colour) in zip(axes[2:], runs if long else (), EULERS if long else (), strict=True):
        first = _shown(simulation, run, PERIODS)
        t = run.t[first]
        panel.plot(t, getattr(run, what)[first] * factor, color=colour, lw=1.0)
        panel.plot(t, getattr(beside.run, what)[first] * factor, **DASHED)
        panel.set_xlim(float(t[0]), float(t[-1]))
    return figure


def _energy(beside: _Beside, runs: Sequence[Trajectory], mass_kg: float | None) -> Figure:
    label = "energy / mJ" if mass_kg is not None else "energy per mass / (mJ/kg)"
    figure, axes = _pair(3.1, ("time / s", label))
    for panel, run, (_, words, colour) in zip(axes, runs, EULERS, strict=True):
        t, energy = _energies(run, run, mass_kg)
        panel.plot(t, energy, color=colour, lw=1.0, label=words)
        top = float(np.max(energy))
        _, energy = _energies(beside.run, run, mass_kg)
        panel.plot(t, energy, label=beside.words, **DASHED)
        low, high = (float(f(energy[energy > 0])) if np.any(energy > 0) else 1.0 for f in (np.min, np.max))
        if top > 20.0 * high or (low > 0 and high > 20.0 * low):
            panel.set_yscale("log")
        else:
            panel.set_ylim(0.0, 1.08 * max(top, high))
        panel.set_xlim(0.0, float(t[-1]))
        legend_above(panel, 2)
    return figure


def _energies(of: Trajectory, run: Trajectory, mass_kg: float | None) -> tuple[F8, F8]:
    """Return times and energies in mJ, up to the end of a run or until its amplitude exceeds ``GROWN``."""
    relative = of.relative_energy()[: len(run.y)]
    limit = np.flatnonzero(run.relative_energy() > GROWN**2)
    end = max(2, int(limit[0])) if limit.size else len(run.y)
    rows = np.unique(np.linspace(0, end - 1, min(end, POINTS)).astype(np.intp))
    start = run.problem.amplitude_m() * run.problem.equation.angular_frequency_per_s
    return of.t[rows], 0.5e3 * (1.0 if mass_kg is None else mass_kg) * start * start * relative[rows]


def _phase(simulation: Simulation, beside: _Beside, runs: Sequence[Trajectory]) -> Figure:
    figure, axes = _pair(3.6, ("displacement / mm", "velocity / (m/s)"))
    for panel, run, (_, words, colour) in zip(axes, runs, EULERS, strict=True):
        rows = _shown(simulation, run, TURNS)
        exact = beside.run
        panel.plot(run.y[rows] * 1e3, run.v[rows], color=colour, lw=1.2, label=words)
        panel.plot(exact.y[rows] * 1e3, exact.v[rows], color="#000000", lw=0.6, label=beside.words)
        panel.plot(run.y[:1] * 1e3, run.v[:1], "o", ms=3.0, color="#000000", label="start")
        legend_above(panel, 2)
    return figure


def _error(simulation: Simulation, beside: _Beside, runs: Sequence[Trajectory]) -> Figure:
    """Draw running maxima of the errors, because an error crosses zero twice per period."""
    figure, (panel,) = panels([3.2])
    start = simulation.problem.amplitude_m() or 1.0
    solution = simulation.solution
    curves = [(run, words, colour) for run, (_, words, colour) in zip(runs, EULERS, strict=True)]
    if solution.integrator.name not in [name for name, *_ in EULERS] and simulation.trajectory is not beside.run:
        curves.append((simulation.trajectory, solution.integrator.words, GREEN))
    for run, words, colour in curves:
        error = np.maximum.accumulate(np.abs(run.y - beside.run.y[: len(run.y)])) / start
        drawn = np.flatnonzero((error > 0) & (error < GROWN))
        thinned = np.linspace(0, drawn.size - 1, min(drawn.size, POINTS)).astype(np.intp)
        rows = drawn[np.unique(thinned)]
        panel.plot(run.t[rows], error[rows], color=colour, label=words)
    if solution.error is not None and 0.0 < solution.error < GROWN:
        panel.axhline(solution.error, label="predicted", **{**DASHED, "lw": 0.8})
    panel.set_yscale("log")
    panel.set_xlim(0.0, float(beside.run.t[-1]))
    panel.set_ylabel("largest error so far / amplitude")
    panel.set_xlabel("time / s")
    legend_above(panel, 2)
    return figure
