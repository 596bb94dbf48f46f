"""Draw Figures 2 to 19 of the lab report, on the bundled recordings, into one picture: `make docs-figures`."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

from matplotlib.figure import Figure
from PIL import Image

from springmass import Run, sample_data
from springmass.charts.chart import Chart, Panel
from springmass.charts.draw import draw, style
from springmass.charts.run import charts_of
from springmass.loading.options import AnalysisOptions
from springmass.simulations import charts
from springmass.simulations.simulation import SimulationOptions, simulated

HERE = Path(__file__).resolve().parent
COLUMNS, WIDTH, HEIGHT = 3, 4.2, 3.0


def charts_of_run(name: str) -> dict[str, Chart]:
    """Return the charts of a run and, under "by NAME", those of its simulation by both Euler methods."""
    data = sample_data()
    how = AnalysisOptions.of({"velocity": data / f"{name}_simulated_velocity.txt", "method": "classic"})
    run = Run.of(data / f"{name}_simulated_position.txt", data / f"{name}.scene.toml", how)
    motion = simulated(run.scene, SimulationOptions(), run)
    own = charts_of(run.analysis, (), run.classic)
    return own | {f"by {c.name}": c for c in charts.simulation(motion)}


def panels() -> list[tuple[str, Panel]]:
    """Return the panels of the figures in the report's order, with their titles."""
    bare, disc = charts_of_run("undamped"), charts_of_run("damped")
    amplitudes = disc["classic"].panels[1]
    alone = tuple(s for s in amplitudes.series if s.label != "its exponential")
    wanted = [
        ("position", bare["position"].panels[0]),
        *(
            (f"{what} by {method}", bare[f"by {what}"].panels[i])
            for what in ("position", "velocity")
            for i, method in METHODS
        ),
        ("energy by forward Euler", bare["by energy"].panels[0]),
        *((f"phase plot by {method}", bare["by phase"].panels[i]) for i, method in METHODS),
        ("position with disc", disc["position"].panels[0]),
        ("amplitude with disc", replace(amplitudes, series=alone)),
        ("amplitude and exponential", amplitudes),
        ("velocity by forward Euler", disc["by velocity"].panels[0]),
        ("energy by forward Euler", disc["by energy"].panels[0]),
        ("position by forward Euler", disc["by position"].panels[0]),
        *((f"phase plot by {method}", disc["by phase"].panels[i]) for i, method in METHODS),
        ("velocity by symplectic Euler", disc["by velocity"].panels[1]),
        ("position by symplectic Euler", disc["by position"].panels[1]),
    ]
    return [(f"Figure {number}: {title}", panel) for number, (title, panel) in enumerate(wanted, 2)]


METHODS = ((0, "forward Euler"), (1, "symplectic Euler"))


def main(folder: Path = HERE) -> Path:
    """Draw the gallery into a folder and return its file."""
    drawn = panels()
    rows = -(-len(drawn) // COLUMNS)
    with style():
        figure = Figure(figsize=(COLUMNS * WIDTH, rows * HEIGHT), layout="constrained")
        for (title, panel), ax in zip(drawn, figure.subplots(rows, COLUMNS).flat, strict=True):
            draw(panel, ax)
            ax.set_title(title, loc="left", fontsize=9)
            ax.legend(fontsize=6, loc="upper right", framealpha=0.8)
        target = folder / "report-figures.png"
        picture = io.BytesIO()
        figure.savefig(picture, format="png", dpi=100)
    Image.open(picture).convert("RGB").quantize(64).save(target, optimize=True)
    return target


if __name__ == "__main__":
    print(main())
