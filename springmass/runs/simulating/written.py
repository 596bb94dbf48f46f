"""Write a simulation: a folder with run file, figures, tables and JSON, and a simulated recording."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from acquisition.block import Block
from acquisition.simulated.rangefinder import VirtualSensor
from acquisition.source import SourceInfo
from pipeline.bench.scene import Scene
from pipeline.dynamics import Problem, Trajectory, effective_mass_kg
from pipeline.dynamics.band import LEVELS, Band
from pipeline.track import F8
from springmass.runs.outputs import in_a_name, made_now, make_folder
from springmass.runs.simulating.prepared import Prepared
from springmass.runs.simulating.readings import plain_block, readings, rest_m
from springmass.runs.simulating.simulation import FINE, Against, Simulation, count_of, solve
from springmass.runs.simulating.summaries import band_columns
from springmass.session.simulated_bench import REST_M

if TYPE_CHECKING:
    from springmass.charts.draw import Kind

PAGE = "simulation.html"
FIGURES = ("position", "velocity", "energy", "phase", "error", "band", "against")
FILES = frozenset(
    {"run.h5", PAGE, "simulation.json", "band.csv", "against.csv"}
    | {f"figures/{name}.{kind}" for name in FIGURES for kind in ("svg", "pdf", "png")}
)


def write_folder(
    simulation: Simulation,
    against: Against | None,
    band: Band | None,
    scene: Scene,
    where: str,
    out: str | Path,
    results: Mapping[str, Any],
    kinds: Sequence[Kind] = (),
) -> Path:
    """Write run file, page of charts, tables, JSON and the kinds of figures into NAME.simulated; return the folder."""
    from springmass.charts import simulation as charted
    from springmass.charts.draw import save
    from springmass.report.html import Figures, drawn_by_script, template
    from storage.atomic import write_whole
    from storage.folder import whole_folder

    name = Path(where).name.removesuffix(".toml").removesuffix(".scene")
    target = make_folder(out) / in_a_name(name, ".simulated")
    charts, tables = list(charted.simulation(simulation, effective_mass_kg(scene))), {}
    trajectory = simulation.trajectory
    if band is not None:
        charts.append(charted.band(simulation, band))
        columns = band_columns(band, trajectory.t, trajectory.y)
        tables["band"] = {"t_s": trajectory.t, "displacement_m": trajectory.y, **columns}
    if against is not None:
        charts.insert(0, charted.against(against))
        tables["against"] = {"t_s": against.t, "measured_m": against.measured, "predicted_m": against.predicted}
        if against.band is not None:
            around = against.predicted + against.band
            tables["against"] |= {f"predicted_{level}_m": each for level, each in zip(LEVELS, around, strict=True)}
    with whole_folder(target, FILES, "simulation.json") as folder:
        title = f"{Path(where).name} by {simulation.solution.integrator.name}"
        configuration = {"rest_m": rest_m(trajectory), **results}
        _write_run(folder / "run.h5", *plain_block(trajectory, Path(where).name), scene, title, configuration)
        drawn = save(charts, make_folder(folder / "figures"), kinds) if kinds else {}
        figures = Figures({name: files["svg"] for name, files in drawn.items() if "svg" in files})
        shown = [figures.add(chart) for chart in charts]
        page = template("charts.html.j2").render(title=title, figures=shown, **drawn_by_script(figures.charts))
        write_whole(folder / PAGE, page)
        for table_name, table in tables.items():
            write_whole(folder / f"{table_name}.csv", _table(table))
        write_whole(folder / "simulation.json", json.dumps(results, indent=2) + "\n")
    return target


def write_readings(
    path: Path,
    ready: Prepared,
    *,
    method: str,
    seconds: float,
    spacing_s: float,
    sensor: str,
    noise_m: float | None,
    echoes_hz: float | None,
    seed: int,
    where: str,
    results: Mapping[str, Any],
) -> None:
    """Write a sensor's readings of a scene's motion, one for each spacing, as a run of the kind "simulated".

    Parameters
    ----------
    path : Path
    ready : Prepared
    method : str
        As in :func:`springmass.runs.simulating.simulation.solve`; the spacing is its step, except for "auto".
    seconds, spacing_s : float
        Duration of the run and time between readings, s.
    sensor : {"ideal", "rangefinder"}
    noise_m, echoes_hz : float or None
        Noise in m and rate of false echoes in Hz. None: the noise of the scene, or else that of the simulated bench,
        and the false-echo rate of the bench.
    seed : int
    where : str
        Name of the scene file.
    results : mapping
        The summary of the simulation, stored in the run file.
    """
    name = Path(where).name
    if sensor == "ideal":
        block, info = plain_block(_fine(ready.problem, method, seconds, spacing_s, 1), name)
    else:
        omega = ready.problem.equation.angular_frequency_per_s
        parts = max(1, math.ceil(FINE * omega * spacing_s)) if method == "auto" else 1
        sigma = ready.stated.sensor_sigma_m
        chosen = {
            "noise_m": noise_m if noise_m is not None else (None if sigma is None else sigma.value),
            "false_echo_rate_hz": echoes_hz,
        }
        virtual = VirtualSensor(
            rate_hz=1.0 / spacing_s, **{key: value for key, value in chosen.items() if value is not None}
        )
        # The sound of the last reading is still on its way to the bob at the end of the run.
        way_s = max(REST_M, 3.0 * ready.problem.amplitude_m()) / virtual.speed_of_sound_m_per_s
        longer = seconds + (2 + math.ceil(way_s / spacing_s)) * spacing_s
        motion = _fine(ready.problem, method, longer, spacing_s, parts)
        block, info = readings(motion, seconds, virtual, name, seed)
    configuration = {"sensor": sensor, "seed": seed, **results}
    _write_run(path, block, info, ready.solved, f"{name}, as a {sensor} sensor reads it", configuration)


def _fine(problem: Problem, method: str, seconds: float, spacing_s: float, parts: int) -> Trajectory:
    count = parts * count_of(seconds, spacing_s)
    return solve(problem, method, spacing_s / parts, count, None).trajectory


def _write_run(
    path: Path, block: Block, info: SourceInfo, scene: Scene, title: str, configuration: Mapping[str, Any]
) -> None:
    from storage.run_file.writing import write_run

    write_run(
        path,
        [block],
        info,
        scene=scene.to_mapping(),
        title=title,
        provenance={**made_now(), "configuration": dict(configuration)},
        overwrite=True,
    )


def _table(columns: Mapping[str, F8]) -> str:
    """Return columns of equal length as CSV text with a header of their names."""
    text = io.StringIO()
    np.savetxt(
        text, np.stack(list(columns.values()), axis=1), "%.9g", delimiter=",", header=",".join(columns), comments=""
    )
    return text.getvalue()
