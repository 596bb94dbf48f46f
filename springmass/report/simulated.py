"""Write a simulation: a folder with run file, charts, tables and JSON, or the readings of a sensor as a run file."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from acquisition.block import Block, SourceInfo
from acquisition.simulated import VirtualRangefinder, VirtualSensor
from pipeline.bench.scene import Scene
from pipeline.dynamics import Trajectory, effective_mass_kg
from pipeline.dynamics.band import LEVELS, Band
from pipeline.track import F8
from springmass.loading.save import made_now
from springmass.result.output_names import in_a_name, make_folder
from springmass.simulations.against import Against
from springmass.simulations.bench import REST_M
from springmass.simulations.simulation import FINE, Prepared, Simulation, count_of, solve

if TYPE_CHECKING:
    from springmass.charts.draw import PictureFormat

SIMULATION_PAGE = "simulation.html"
FIGURES = ("position", "velocity", "energy", "phase", "error", "band", "against")
FILES = frozenset(
    {"run.h5", SIMULATION_PAGE, "simulation.json", "band.csv", "against.csv"}
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
    kinds: Sequence[PictureFormat] = (),
) -> Path:
    """Write run file, page of charts, tables, JSON and the kinds of figures into NAME.simulated; return the folder."""
    from springmass.charts.draw import save
    from springmass.report.html import Figures, drawn_by_script, template
    from springmass.simulations import charts as charted
    from storage.atomic import whole_folder, write_whole

    name = Path(where).name.removesuffix(".toml").removesuffix(".scene")
    target = make_folder(out) / in_a_name(name, ".simulated")
    charts, tables = list(charted.simulation(simulation, effective_mass_kg(scene), against)), {}
    trajectory = simulation.trajectory
    if band is not None:
        charts.append(charted.band(simulation, band))
        tables["band"] = _band_columns(band, trajectory.t, trajectory.y)
    if against is not None:
        charts.insert(0, charted.against(against))
        tables["against"] = {"t_s": against.t, "measured_m": against.measured, "predicted_m": against.predicted}
        if against.band is not None:
            tables["against"] |= _edges("predicted", against.predicted + against.band, "m")
    with whole_folder(target, FILES, "simulation.json") as folder:
        title = f"{Path(where).name} by {simulation.solution.integrator.name}"
        configuration = {"rest_m": _rest_m(trajectory), **results}
        _write_run(folder / "run.h5", *_exact(trajectory, Path(where).name), scene, title, configuration)
        figures = Figures(save(charts, make_folder(folder / "figures"), kinds) if kinds else {})
        shown = [figures.add(chart) for chart in charts]
        page = template("charts.html.j2").render(title=title, figures=shown, **drawn_by_script(figures.charts))
        write_whole(folder / SIMULATION_PAGE, page)
        for table_name, table in tables.items():
            write_whole(folder / f"{table_name}.csv", _table(table))
        write_whole(folder / "simulation.json", json.dumps(results, indent=2) + "\n")
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


def write_readings(
    path: Path, ready: Prepared, found: Simulation, sensor: str, seed: int, where: str, results: Mapping[str, Any]
) -> None:
    """Write a sensor's readings of a simulated motion, one for each spacing, as a run of the kind "simulated".

    The noise is that of the scene's sensor, or else that of the simulated bench.
    """
    name, motion = Path(where).name, found.trajectory
    if sensor == "ideal":
        block, info = _exact(motion, name)
    else:
        virtual = VirtualSensor(rate_hz=1.0 / motion.spacing_s)
        if ready.stated.sensor_sigma_m is not None:
            virtual = replace(virtual, noise_m=ready.stated.sensor_sigma_m.value)
        block, info = _readings(found, virtual, name, seed)
    configuration = {"sensor": sensor, "seed": seed, **results}
    _write_run(path, block, info, ready.solved, f"{name}, as a {sensor} sensor reads it", configuration)


def _rest_m(trajectory: Trajectory) -> float:
    """Return a rest distance in m at which the bob never touches the sensor."""
    return max(REST_M, 2.0 * float(np.max(np.abs(trajectory.y))))


def _exact(trajectory: Trajectory, name: str) -> tuple[Block, SourceInfo]:
    """Return the states as a sensor without noise, echoes or resolution would read them, with their velocities."""
    distance = _rest_m(trajectory) + trajectory.y
    block = Block(0, trajectory.t, distance, np.zeros(len(distance), np.uint8), velocity=trajectory.v.copy())
    return block, SourceInfo("simulated", name, 1.0 / trajectory.spacing_s)


def _readings(found: Simulation, sensor: VirtualSensor, name: str, seed: int) -> tuple[Block, SourceInfo]:
    """Return a rangefinder's readings of the motion, solved again with states close enough for interpolation."""
    problem, spacing_s, seconds = found.problem, found.trajectory.spacing_s, float(found.trajectory.t[-1])
    omega, rest = problem.equation.angular_frequency_per_s, _rest_m(found.trajectory)
    # The sound of the last reading is still on its way to the bob at the end of the run.
    longer_s = seconds + 2.0 * spacing_s + 3.0 * rest / sensor.speed_of_sound_m_per_s
    parts = max(1, math.ceil(FINE * omega * spacing_s)) if found.solution.chosen else 1
    method = "auto" if found.solution.chosen else found.solution.integrator.name
    count = parts * (count_of(longer_s, spacing_s) + 1)
    motion = solve(problem, method, spacing_s / parts, count, None).trajectory

    def position(t: float) -> float:
        return rest + float(motion.at(np.array([t]))[0])

    finder = VirtualRangefinder(position, sensor, np.random.default_rng(seed))
    return finder.block(seconds + 1.0 / sensor.rate_hz), finder.info(name)


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
    rows = np.stack(list(columns.values()), axis=1)
    np.savetxt(text, rows, "%.9g", delimiter=",", header=",".join(columns), comments="")
    return text.getvalue()
