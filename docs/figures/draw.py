"""Draw the figures of the documentation through the report's own: `make docs-figures`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import rooms

from pipeline.errors import DynamicsError
from pipeline.simulation import Equation, Integrator, Problem, get_integrator
from springmass import analyse, sample_data
from springmass.charts.draw import legend, render, style, written
from springmass.charts.run import amplitude

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RUN_STEPS = 4000
HERE = Path(__file__).resolve().parent


def main(folder: Path = HERE) -> list[Path]:
    """Draw every figure into a folder and return the files."""
    data = sample_data()
    velocity = data / "damped_simulated_velocity.txt"
    run = analyse(data / "damped_simulated_position.txt", data / "damped.scene.toml", velocity=velocity)
    target = folder / "amplitude.svg"
    chart = amplitude(run.analysis)
    assert chart is not None
    target.write_bytes(render(chart, ("svg",))["svg"])
    stability = folder / "stability.svg"
    with style():
        stability.write_bytes(written(stability_figure(), "svg"))
    return [target, stability, rooms.main(folder)]


def largest_step(integrator: Integrator, ratio: float) -> float:
    """Return the largest stable omega h at a damping ratio gamma / omega."""
    return integrator.stable_step(Problem(Equation(angular_frequency_per_s=1.0, gamma_per_s=float(ratio)), 1.0))


def runs_bounded(integrator: Integrator, x: float, ratio: float) -> bool:
    """Return whether a run of many steps of x = omega h ends with no more energy than it began with.

    A step just inside the limit may swell before it settles, so the energy is looked at after the first half only.
    """
    problem = Problem(Equation(angular_frequency_per_s=1.0, gamma_per_s=ratio), 1.0)
    try:
        run = integrator.run(problem, x, RUN_STEPS, every=RUN_STEPS // 2)
        middle, end = run.relative_energy()[1:]
    except DynamicsError:
        return False
    return bool(end <= middle * (1.0 + 1e-9) and math.isfinite(end))


def stability_figure() -> Figure:
    """Draw the stability map: the largest stable step against damping as theory has it, and runs on both sides.

    Raises
    ------
    ValueError
        If a run contradicts its line.
    """
    ratios = np.geomspace(0.01, 100.0, 161)
    checked = np.geomspace(0.02, 60.0, 8)
    looks = (
        ("forward-euler", "#b84a00"),
        ("symplectic-euler", "#0063a0"),
        ("verlet", "#00704f"),
    )
    from matplotlib.figure import Figure

    with style():
        figure = Figure(figsize=(7.2, 3.8))
        panel = figure.subplots()
        panel.set_xscale("log")
        panel.set_yscale("log")
        for name, colour in looks:
            method = get_integrator(name)
            panel.plot(ratios, [largest_step(method, ratio) for ratio in ratios], color=colour, label=name)
            for ratio in checked.tolist():
                limit = largest_step(method, ratio)
                for share, bounded, marker in ((0.97, True, "o"), (1.03, False, "x")):
                    if runs_bounded(method, share * limit, ratio) != bounded:
                        raise ValueError(f"{name} at gamma/omega {ratio:g}: a run contradicts its limit {limit:g}")
                    # Drawn farther from the line than it was run, to be seen apart.
                    at = limit * (0.9 if bounded else 1.11)
                    panel.plot([ratio], [at], marker, ms=3.2 if bounded else 4.0, color=colour, mew=1.0)
        panel.set_xlabel("damping ratio gamma / omega")
        panel.set_ylabel("largest stable step / radians")
        panel.set_xlim(ratios[0], ratios[-1])
        legend(panel)
        return figure


if __name__ == "__main__":
    for written in main():
        print(f"{written.name}: {written.stat().st_size} bytes")
