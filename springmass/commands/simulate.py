"""``springmass simulate``: the equation of motion of a scene, solved, with the error that was expected and made."""

from __future__ import annotations

import argparse
import io
import json
import math
import shlex
import sys
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.block import Block
from acquisition.errors import visible
from acquisition.source import SourceInfo
from pipeline.bench.scene import Scene
from pipeline.dynamics import Problem, effective_mass_kg
from pipeline.dynamics.band import LEVELS, Band, spread, uncertain
from pipeline.dynamics.choose import Choice
from pipeline.errors import DynamicsError
from pipeline.numerics.estimate import Joint
from pipeline.track import F8
from springmass.commands import completions
from springmass.errors import OK, USAGE, ProgramError, suggest, tell
from springmass.runs.analysing import in_a_name, made_now, make_folder
from springmass.runs.loading import load
from springmass.runs.scenes import ask_about, read_scene
from springmass.runs.simulation import (
    Against,
    Simulation,
    band_columns,
    count_of,
    demand_stable,
    plan,
    simulate,
    summary,
)
from springmass.session.simulated_bench import REST_M

__all__ = ["run"]


def run(options: argparse.Namespace) -> int:
    """Plan, tell what error to expect, run, tell what it was, and write what was made."""
    if options.dt <= 0:
        raise ProgramError(f"--dt must be more than 0 s, got {options.dt:g}", USAGE)
    count = count_of(options.seconds, options.dt)
    scene, analysis, measured = read_scene(options.scene), None, None
    ask_about(scene, options.scene)
    seconds = options.seconds
    if options.against is not None:
        from pipeline.analyse import analyse
        from springmass.runs.against import completed, duration_s, lay_over

        analysis = analyse(load(options.against, **completions(options)).track, scene)
        scene, measured = completed(scene, analysis)
        seconds = max(seconds, duration_s(analysis))
        tell(f"from {options.against}: {', '.join(measured.names)}")
    problem = Problem.from_scene(scene, where=options.scene)
    try:
        choice = plan(problem, options.method, options.dt, count, options.tolerance)
    except DynamicsError as error:
        raise ProgramError(f"{options.scene}: {error}", USAGE) from error
    if not options.force:
        demand_stable(choice, where=options.scene)
    say = sys.stderr if options.json else sys.stdout
    print(_before(choice, count), file=say, flush=True)
    simulation = simulate(problem, choice, options.dt, count)
    print(f"measured error   {simulation.measured_error:.2g} of the amplitude", file=say)
    band = _band(scene, seconds, measured)
    against = None
    if analysis is not None:
        against = lay_over(analysis, problem, options.method, options.dt, options.tolerance, band)
        print(
            f"against the run  rms {against.rms_m * 1e3:.3g} mm, noise of a sample {against.noise_m * 1e3:.3g} mm",
            file=say,
        )
    if options.out is not None or not options.json:
        folder = _write(simulation, against, band, scene, options)
        print(f"written          {visible(str(folder))}", file=say)
        suggest(f"springmass analyse {shlex.quote(str(folder / 'run.h5'))} --scene {shlex.quote(options.scene)}")
    if options.json:
        print(json.dumps(summary(simulation, against, band)))
    return OK


def _band(scene: Scene, seconds: float, measured: Joint | None) -> Band | None:
    """The band of what is uncertain; where there is none, say why."""
    names = uncertain(scene, measured).names
    if not names:
        print("band             none: the scene states no uncertainties", file=sys.stderr)
        return None
    try:
        band = spread(scene, seconds, measured)
    except DynamicsError as error:
        print(f"band             none: {error}", file=sys.stderr)
        return None
    print(
        f"band             {band.members} motions drawn from the uncertainties of {', '.join(names)}", file=sys.stderr
    )
    return band


def _before(choice: Choice, count: int) -> str:
    """What is about to run, and what to expect of it."""
    error = (
        f"{choice.predicted_error:.2g} of the amplitude"
        if math.isfinite(choice.predicted_error)
        else "beyond all bounds"
    )
    lines = [f"method           {choice.integrator.words}"]
    if choice.integrator.order:
        lines.append(f"step             {choice.step_s:.6g} s, {choice.parts * count} steps")
    lines += [
        f"left out         {term.name}: {term.why}" for term in choice.terms if term.size > 0 and not term.included
    ]
    return "\n".join([*lines, f"predicted error  {error}"])


def _write(
    simulation: Simulation, against: Against | None, band: Band | None, scene: Scene, options: argparse.Namespace
) -> Path:
    """Write run file, figures, tables and JSON into NAME.simulated; return the folder."""
    from springmass.report.figures import save
    from springmass.report.figures.simulation import against_figure, band_figure, draw_simulation
    from storage.atomic import write_whole
    from storage.folder import whole_folder

    name = Path(options.scene).name.removesuffix(".toml").removesuffix(".scene")
    target = make_folder(options.out or ".") / in_a_name(name, ".simulated")
    told = summary(simulation, against, band)
    figures, tables = draw_simulation(simulation, effective_mass_kg(scene)), {}
    if band is not None:
        t, y = simulation.trajectory.t, simulation.trajectory.y
        figures["band"] = band_figure(simulation, band)
        tables["band"] = {"t_s": t, "displacement_m": y, **band_columns(band, t, y)}
    if against is not None:
        figures["against"] = against_figure(against)
        tables["against"] = {"t_s": against.t, "measured_m": against.measured, "predicted_m": against.predicted}
        if against.band is not None:
            around = against.predicted + against.band
            tables["against"] |= {f"predicted_{level}_m": each for level, each in zip(LEVELS, around, strict=True)}
    with whole_folder(target, FILES, "simulation.json") as folder:
        _write_run(folder / "run.h5", simulation, scene, options, told)
        pictures = make_folder(folder / "figures")
        for title, figure in figures.items():
            save(figure, pictures, title)
        for title, columns in tables.items():
            write_whole(folder / f"{title}.csv", _table(columns))
        write_whole(folder / "simulation.json", json.dumps(told, indent=2) + "\n")
    return target


FIGURES = ("position", "velocity", "energy", "phase", "error", "band", "against")
FILES = frozenset(
    {"run.h5", "simulation.json", "band.csv", "against.csv"}
    | {f"figures/{name}.{kind}" for name in FIGURES for kind in ("svg", "pdf")}
)


def _table(columns: dict[str, F8]) -> str:
    """Columns of equal length as text, their names above."""
    text = io.StringIO()
    np.savetxt(
        text, np.stack(list(columns.values()), axis=1), "%.9g", delimiter=",", header=",".join(columns), comments=""
    )
    return text.getvalue()


def _write_run(
    path: Path, simulation: Simulation, scene: Scene, options: argparse.Namespace, told: dict[str, Any]
) -> None:
    """Write the trajectory as a run of kind ``simulated``: a sensor without noise, as far away as the bob needs."""
    from storage.run_file.writing import write_run

    trajectory = simulation.trajectory
    rest = max(REST_M, 2.0 * float(np.max(np.abs(trajectory.y))))
    block = Block(
        0, trajectory.t, rest + trajectory.y, np.zeros(len(trajectory.y), np.uint8), velocity=trajectory.v.copy()
    )
    write_run(
        path,
        [block],
        SourceInfo("simulated", Path(options.scene).name, 1.0 / trajectory.spacing_s),
        scene=scene.to_mapping(),
        title=f"{Path(options.scene).name} by {simulation.choice.integrator.name}",
        provenance={
            **made_now(),
            "configuration": {"rest_m": rest, **told},
        },
        overwrite=True,
    )
