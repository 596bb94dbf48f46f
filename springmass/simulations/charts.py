"""Charts of a simulation: both Euler methods beside the exact motion, the band, and the run that is predicted."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from pipeline.simulation import Trajectory, effective_mass_kg
from pipeline.simulation.band import Band
from pipeline.track import F8
from springmass.charts.chart import Chart, Panel, Series, band_of, line_of
from springmass.simulations.against import Against
from springmass.simulations.simulation import EULERS, Eulers, Simulation, beside_exact

PERIODS_DRAWN, TURNS = 14, 6  # periods in the detail of a long run; turns in a phase plot
POINTS_DRAWN = 1500
GROWN = 1e6  # multiple of the starting amplitude above which curves are cut off


def simulation(solved: Simulation) -> list[Chart]:
    """Return the charts of a simulation, with those of the run and of the band if there are any."""
    over = [] if solved.against is None else [against(solved.against)]
    return [*over, *methods(solved), *([] if solved.band is None else [band(solved, solved.band)])]


def methods(solved: Simulation) -> tuple[Chart, ...]:
    """Return the charts of the Euler methods; without a mass, the energy is that of one kilogram."""
    runs, mass_kg, over = beside_exact(solved), effective_mass_kg(solved.ready.solved), solved.against
    exact = runs.exact
    period = 2.0 * math.pi / float(solved.problem.equation.angular_frequency_per_s)
    turns = max(2, int(TURNS * period / exact.spacing_s) + 1)
    end = PERIODS_DRAWN * period if exact.t[-1] > 2 * PERIODS_DRAWN * period else None
    label, kg = ("E per mass / (mJ/kg)", 1.0) if mass_kg is None else ("E / mJ", mass_kg)
    beside_run = _measured(solved, kg, over, exact.t[-1], TURNS * period)
    of_position = _both(runs, "y / mm", lambda of, n: (of.t[:n], of.y[:n] * 1e3), beside_run[:1])
    of_velocity = _both(runs, "v / (m/s)", lambda of, n: (of.t[:n], of.v[:n]), beside_run[1:2])
    of_energy = _both(runs, label, lambda of, n: _energy(of, n, kg), beside_run[2:3], log=True)
    of_phase = _both(
        runs,
        "v / (m/s)",
        lambda of, n: (of.y[: min(n, turns)] * 1e3, of.v[: min(n, turns)]),
        beside_run[3:],
        equal=True,
    )
    beside = "Each method beside the exact motion" + (", and the measured run." if beside_run else ".")
    return (
        Chart("position", "Position", beside, of_position, end),
        Chart("velocity", "Velocity", beside, of_velocity, end),
        Chart("energy", "Energy", f"{beside} {_growth(solved)}", of_energy),
        Chart("phase", "Phase plot", f"The first {TURNS} turns of each method.", of_phase),
        Chart(
            "error", "Error of each method", "Largest difference so far from the exact motion.", _error(solved, runs)
        ),
    )


def _growth(solved: Simulation) -> str:
    forward, _ = solved.growths
    measured = "" if forward.measured is None else f", as computed here by {forward.measured:.6f}"
    return f"Each step of forward Euler multiplies the amplitude by √(1 + ω²h²) = {forward.predicted:.6f}{measured}."


def _both(
    runs: Eulers,
    label: str,
    values: Callable[[Trajectory, int], tuple[F8, F8]],
    measured: Sequence[Series] = (),
    *,
    log: bool | None = None,
    equal: bool = False,
) -> tuple[Panel, ...]:
    """Return a panel for each method; ``values`` takes a trajectory and the number of its rows."""
    panels = []
    for words, run in zip((euler.words for euler in EULERS), runs.eulers, strict=True):
        x, y = values(run, len(run.y))
        beside_x, beside_y = values(runs.exact, len(run.y))
        lines = (line_of(runs.words, beside_x, beside_y), Series(words, x, y, "other" if measured else "data", True))
        grows = log and float(np.min(y)) > 0.0 and float(np.max(y)) > 20.0 * float(np.max(beside_y))
        height, x_label = (3.6, "displacement y / mm") if equal else (2.4, "time / s")
        # Beside points an axis would not show all of a line that leaves them.
        every = (*(replace(each, line=True) for each in measured), *lines)
        panel = Panel(f"{words}: {label}", every, height, x_label, log=log and bool(grows), equal=equal)
        panels.append(replace(panel, series=(*measured, *lines), range=panel.reach()) if measured else panel)
    return tuple(panels)


def _energy(of: Trajectory, count: int, mass_kg: float) -> tuple[F8, F8]:
    """Return times and energies in mJ, up to the end of a run or until its amplitude exceeds ``GROWN``."""
    relative = of.relative_energy()[:count]
    grown = np.flatnonzero(relative > GROWN**2)
    end = max(2, int(grown[0])) if grown.size else count
    rows = np.unique(np.linspace(0, end - 1, min(end, POINTS_DRAWN)).astype(np.intp))
    start = of.problem.amplitude_m() * of.problem.equation.angular_frequency_per_s
    return of.t[rows], 0.5e3 * mass_kg * start * start * relative[rows]


def _measured(solved: Simulation, mass_kg: float, over: Against | None, end_s: float, turns_s: float) -> list[Series]:
    """Return a measured run to its end: displacement in mm, velocity in m/s, energy in mJ, and its first turns."""
    if over is None:
        return []
    rows = over.free[0] <= end_s
    t, y, v = (each[rows] for each in over.free)
    omega = solved.problem.equation.angular_frequency_per_s
    energy = 0.5e3 * mass_kg * (v**2 + (omega * y) ** 2)
    first = t <= turns_s
    return [
        *(Series("measured", t, each) for each in (y * 1e3, v, energy)),
        Series("measured", y[first] * 1e3, v[first]),
    ]


def _error(solved: Simulation, runs: Eulers) -> tuple[Panel, ...]:
    """Return running maxima of the errors, because an error crosses zero twice per period."""
    start = solved.problem.amplitude_m() or 1.0
    curves = [(run, euler.words) for run, euler in zip(runs.eulers, EULERS, strict=True)]
    if solved.solution.integrator.name not in [euler.name for euler in EULERS] and solved.trajectory is not runs.exact:
        curves.append((solved.trajectory, solved.solution.integrator.words))
    series = []
    for run, words in curves:
        error = np.maximum.accumulate(np.abs(run.y - runs.exact.y[: len(run.y)])) / start
        drawn = np.flatnonzero((error > 0) & (error < GROWN))
        rows = drawn[np.unique(np.linspace(0, drawn.size - 1, min(drawn.size, POINTS_DRAWN)).astype(np.intp))]
        series.append(line_of(words, run.t[rows], error[rows], "other"))
    predicted = solved.solution.error
    if predicted is not None and 0.0 < predicted < GROWN:
        ends = runs.exact.t[[0, -1]]
        series.append(line_of("predicted", ends, np.full(2, predicted)))
    return (Panel("largest error so far / amplitude", tuple(series), 3.0, log=True),)


def against(compared: Against) -> Chart:
    """A measured run with its prediction and the band from the uncertain inputs, and the residuals."""
    bands = [] if compared.band is None else _bands(compared.t, compared.band, 1e3)
    over = [] if compared.band is None else _bands(compared.t, compared.band + compared.predicted, 1e3)
    predicted = line_of("predicted", compared.t, compared.predicted * 1e3)
    measured = Series("measured", compared.t, compared.measured * 1e3)
    residual = Series("residual", compared.t, (compared.measured - compared.predicted) * 1e3)
    panels = (
        Panel("distance / mm", (*over, predicted, measured)),
        Panel("residual / mm", (*bands, residual), 1.6, zero=True),
    )
    return Chart("against", "Measured and predicted", "The measured run over the prediction of its scene.", panels)


def band(solved: Simulation, spread: Band) -> Chart:
    """Motion, amplitude and phase with the band from the scene's uncertainties, and the band alone."""
    end = float(solved.trajectory.t[-1])
    # The motion is drawn for the last periods, where the grid is fine enough; amplitude and band for the whole run.
    period = 2.0 * math.pi / float(solved.problem.equation.angular_frequency_per_s)
    last: F8 = np.linspace(max(0.0, end - PERIODS_DRAWN * period), end, POINTS_DRAWN)
    whole = spread.t[spread.t <= end]
    amplitude, of_amplitude = spread.amplitude_at(whole)
    middle = solved.trajectory.at(last)
    law, late = "the scene's values", "time in the last periods / s"
    motion = (*_bands(last, middle + spread.displacement_at(last), 1e3), line_of(law, last, middle * 1e3))
    size = (*_bands(whole, of_amplitude, 1e3), line_of(law, whole, amplitude * 1e3))
    panels = (
        Panel("displacement / mm", motion, 2.0, late),
        Panel("amplitude / mm", size, 1.6),
        Panel("phase / rad", tuple(_bands(whole, spread.phase_at(whole), 1.0)), 1.6),
        Panel("band / mm", tuple(_bands(whole, spread.displacement_at(whole), 1e3)), 1.6),
    )
    return Chart("band", "Band", "Where 68 % and 95 % of all such benches would be.", panels)


def _bands(t: F8, levels: F8, factor: float) -> list[Series]:
    """Return the bands between the quantiles (4, n) of 95 % and 68 %."""
    bands = []
    for low, high, share in ((0, 3, 95), (1, 2, 68)):
        middle, half = 0.5 * (levels[high] + levels[low]), 0.5 * (levels[high] - levels[low])
        bands.append(band_of(f"{share} %", t, middle * factor, half * factor))
    return bands
