"""``springmass simulate``: the equation of motion of a scene, solved, with the error that was expected and made."""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.block import Block
from acquisition.source import SourceInfo
from pipeline.bench.scene import Scene
from pipeline.dynamics import Problem, effective_mass_kg
from pipeline.dynamics.choose import Choice
from pipeline.errors import DynamicsError
from springmass import __version__
from springmass.errors import OK, USAGE, ProgramError
from springmass.runs.analysing import make_folder, now_utc
from springmass.runs.loading import load, read_scene
from springmass.runs.simulation import (
    Against,
    Simulation,
    compare_with,
    completed,
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
    scene, analysis = read_scene(options.scene), None
    if options.against is not None:
        from pipeline.analyse import analyse

        analysis = analyse(load(options.against).track, scene)
        scene, taken = completed(scene, analysis)
        print(f"from {options.against}: {', '.join(taken)}", file=sys.stderr)
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
    against = None if analysis is None else compare_with(analysis, problem)
    if against is not None:
        print(
            f"against the run  rms {against.rms_m * 1e3:.3g} mm, noise of a sample {against.noise_m * 1e3:.3g} mm",
            file=say,
        )
    if options.out is not None or not options.json:
        folder = _write(simulation, against, scene, options)
        print(f"written          {folder}", file=say)
    if options.json:
        print(json.dumps(summary(simulation, against)))
    return OK


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


def _write(simulation: Simulation, against: Against | None, scene: Scene, options: argparse.Namespace) -> Path:
    """Write run file, figures and JSON into NAME.simulated; return the folder."""
    from springmass.report.figures import render
    from springmass.report.simulation_figures import against_figure, draw_simulation
    from storage.atomic import write_whole

    name = Path(options.scene).name.removesuffix(".toml").removesuffix(".scene")
    folder = make_folder(make_folder(options.out or ".") / f"{name}.simulated")
    pictures = make_folder(folder / "figures")
    told = summary(simulation, against)
    _write_run(folder / "run.h5", simulation, scene, options, told)
    figures = draw_simulation(simulation, effective_mass_kg(scene))
    if against is not None:
        figures["against"] = against_figure(against)
    else:
        for kind in ("svg", "pdf"):  # of an earlier simulation, it would pass for one of this
            (pictures / f"against.{kind}").unlink(missing_ok=True)
    for title, figure in figures.items():
        for kind in ("svg", "pdf"):
            write_whole(pictures / f"{title}.{kind}", render(figure, kind))  # type: ignore[arg-type]
    write_whole(folder / "simulation.json", json.dumps(told, indent=2) + "\n")
    return folder


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
            "software": "springmass",
            "version": __version__,
            "created_utc": now_utc(),
            "configuration": {"rest_m": rest, **told},
        },
        overwrite=True,
    )
