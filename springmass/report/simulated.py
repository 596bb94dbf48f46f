"""Write the folder of a simulation: its run file, a page of charts, figures, tables and JSON."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pipeline.simulation.band import LEVELS, Band
from pipeline.track import F8
from springmass.result.output_names import in_a_name, make_folder
from springmass.simulations.run_files import write_states
from springmass.simulations.simulation import Simulation, beside_measured, simulation_json

if TYPE_CHECKING:
    from springmass.charts.draw import Counting, PictureFormat

SIMULATION_PAGE = "simulation.html"
FIGURES = ("position", "velocity", "energy", "phase", "error", "band", "against")
FILES = frozenset(
    {"run.h5", SIMULATION_PAGE, "simulation.json", "band.csv", "against.csv"}
    | {f"figures/{name}.{kind}" for name in FIGURES for kind in ("svg", "pdf", "png")}
)


def write(
    out: str | Path, simulation: Simulation, figures: Sequence[PictureFormat] = (), counting: Counting = iter
) -> Path:
    """Write run file, page of charts, tables, JSON and the kinds of figures into NAME.simulated; return the folder."""
    from springmass.charts.draw import save
    from springmass.report.html import Figures, drawn_by_script, template
    from springmass.simulations import charts as charted
    from storage.atomic import whole_folder, write_whole

    where, trajectory = Path(simulation.where).name, simulation.trajectory
    target = make_folder(out) / in_a_name(where.removesuffix(".toml").removesuffix(".scene"), ".simulated")
    charts, tables = charted.simulation(simulation), {}
    if simulation.band is not None:
        tables["band"] = _band_columns(simulation.band, trajectory.t, trajectory.y)
    if (against := simulation.against) is not None:
        tables["against"] = {"t_s": against.t, "measured_m": against.measured, "predicted_m": against.predicted}
        if against.band is not None:
            tables["against"] |= _edges("predicted", against.predicted + against.band, "m")
    with whole_folder(target, FILES, "simulation.json") as folder:
        title = f"{where} by {simulation.solution.integrator.name}"
        write_states(folder / "run.h5", simulation, title)
        named = {chart.name: chart for chart in charts}
        drawn = Figures(save(named, make_folder(folder / "figures"), figures, counting) if figures else {})
        shown = [drawn.add(chart) for chart in charts]
        beside = beside_measured(simulation)
        page = template("charts.html.j2").render(
            title=title, figures=shown, beside=beside, **drawn_by_script(drawn.charts)
        )
        write_whole(folder / SIMULATION_PAGE, page)
        for table_name, table in tables.items():
            write_whole(folder / f"{table_name}.csv", _table(table))
        write_whole(folder / "simulation.json", json.dumps(simulation_json(simulation), indent=2) + "\n")
    return target


def _band_columns(band: Band, t: F8, predicted: F8) -> dict[str, F8]:
    amplitude, of_amplitude = band.amplitude_at(t)
    return {
        "t_s": t,
        "displacement_m": predicted,
        **_edges("displacement", predicted + band.displacement_at(t), "m"),
        "amplitude_m": amplitude,
        **_edges("amplitude", of_amplitude, "m"),
        **_edges("phase", band.phase_at(t), "rad"),
    }


def _edges(name: str, quantiles: F8, unit: str) -> dict[str, F8]:
    return {f"{name}_{level}_{unit}": each for level, each in zip(LEVELS, quantiles, strict=True)}


def _table(columns: Mapping[str, F8]) -> str:
    """Return columns of equal length as CSV text with a header of their names."""
    text = io.StringIO()
    rows = np.stack(list(columns.values()), axis=1)
    np.savetxt(text, rows, "%.9g", delimiter=",", header=",".join(columns), comments="")
    return text.getvalue()
