"""``springmass simulate``: the motion that a scene predicts, its uncertainty, and the cost of computing it."""

import json
import math
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from acquisition.errors import visible
from pipeline.quantities import EFFECTS
from pipeline.results.effects import Effect
from springmass.commands.given import GivenOptions
from springmass.commands.options import FiguresOption, FileArgument, Json, Overwrite, ReadPairs
from springmass.commands.parameters import Finite, Positive, Whole, flag, option, output
from springmass.errors import HINT, LOG, OK, ProgramError
from springmass.loading.inputs import RUN_SUFFIXES
from springmass.loading.options import AnalysisOptions
from springmass.loading.scenes import ask_about, read_scene
from springmass.runs.run import Run
from springmass.simulations.against import deviation_text
from springmass.simulations.simulation import (
    Growth,
    Simulation,
    SimulationOptions,
    UnstableStep,
    beside_measured,
    prediction,
    simulated,
    simulation_json,
)
from springmass.terminal.printing import aligned, wrapped


def simulate(
    *,
    scene: Annotated[
        FileArgument | None, option("S.toml", "scene file: masses, spring, start, damping (default: that of RUN)")
    ] = None,
    method: Annotated[str, option("NAME", "integrator, or auto (default: auto)")] = "auto",
    dt: Annotated[Positive, option("S", "sampling interval and step of the solver, s (default: 0.01)")] = 0.01,
    seconds: Annotated[
        Positive | None, option("N", "length of the simulation, s (default: that of RUN, else 10)")
    ] = None,
    tolerance: Annotated[
        Finite | None, option("E", "largest error relative to the amplitude (default: from the band)")
    ] = None,
    check: Annotated[bool, flag("also measure the error; this takes longer than the simulation")] = False,
    force: Annotated[bool, flag("simulate even if the step is unstable")] = False,
    against: Annotated[FileArgument | None, option("RUN", "measured run to compare with the prediction")] = None,
    output: Annotated[
        FileArgument | None,
        output("OUT", "RUN.h5 for the readings of a sensor, or the folder of NAME.simulated (default: here)"),
    ] = None,
    overwrite: Overwrite = False,
    sensor: Annotated[Literal["ideal", "rangefinder"], option("NAME", "sensor of RUN.h5 (default: rangefinder)")] = (
        "rangefinder"
    ),
    seed: Annotated[Whole, option("N", "seed of the sensor's noise (default: 0)")] = 0,
    figures: FiguresOption = (),
    full: Annotated[bool, flag("also print effects, tolerance, cost, and what would explain the run")] = False,
    as_json: Json = False,
    reading: ReadPairs = ReadPairs(),
    given: GivenOptions,
) -> int:
    """Solve the equation of a scene, print its prediction beside a measured run, and write the output."""
    if scene is None and against is None:
        raise ProgramError("simulate needs --scene S.toml, or --against RUN with a scene of its own")
    if against is None:
        given.refuse("without --against", "--read")
    run_file = Path(output) if output is not None and Path(output).suffix.lower() in RUN_SUFFIXES else None
    folder = None if run_file or (as_json and output is None) else output or "."
    if run_file is None:
        given.refuse("without -o RUN.h5", "--sensor", "--seed", "--overwrite")
    if folder is None:
        given.refuse("without a folder, which -o DIR names", "--figures")
    where, say = str(against if scene is None else scene), sys.stderr if as_json else sys.stdout
    if run_file is not None and run_file.exists() and not overwrite:
        raise ProgramError(f"{visible(str(run_file))}: exists", "take another name, or --overwrite")
    stated = run = None
    if scene is not None:
        stated = read_scene(scene)
        ask_about(stated, scene)
    if against is not None:
        run = Run.of(against, stated, AnalysisOptions(**reading.options.given()))
        stated = run.scene
    assert stated is not None
    options = SimulationOptions(
        method=method, spacing_s=dt, seconds=seconds, tolerance=tolerance, check=check, force=force
    )
    try:
        simulation = simulated(stated, options, run, where)
    except UnstableStep as error:
        smaller = f"take --dt {error.limit} or less, " if error.limit else "take "
        remedy = f"{smaller}--method {error.other}, or --force to run it all the same"
        raise ProgramError(error.problem, remedy, where=f"{where}: ") from error
    print(_described(simulation, full=full), file=say)
    made = run_file
    if run_file is not None:
        from springmass.simulations.run_files import write_readings

        write_readings(run_file, simulation, sensor, seed)
    elif folder is not None:
        from springmass.report.simulated import write
        from springmass.terminal.progress import counted_figures

        made = write(folder, simulation, figures, counted_figures)
    if made is not None:
        print(f"written          {visible(str(made))}", file=say)
        of_scene = "" if scene is None else f" --scene {shlex.quote(where)}"
        LOG.log(HINT, f"springmass analyse {shlex.quote(str(run_file or made / 'run.h5'))}{of_scene}")
    if as_json:
        print(json.dumps(simulation_json(simulation)))
    return OK


def _described(simulation: Simulation, *, full: bool) -> str:
    """Return the lines about a simulation, the expert ones only with ``full``."""
    lines, over = [], simulation.against
    rows = [("", "predicted", "measured", "difference / u")]
    for row in beside_measured(simulation):
        apart = "from the run" if row.apart is None else f"{row.apart:+.1f}"
        rows.append((row.label, str(row.value), str(row.measured), apart))
    lines += [aligned(rows), ""] if len(rows) > 1 else []
    if over is not None:
        left = f"rms {over.rms_m * 1e3:.3g} mm, noise of one sample {over.noise_m * 1e3:.3g} mm"
        lines += [f"against the run  {left}", *(deviation_text(over) if full else [])]
    lines.append(f"prediction       {_predicted(simulation)}")
    if full:
        lines += [wrapped(f"band             {simulation.of_band}", " " * 17), *_acting(simulation.effects)]
        if simulation.tolerance is not None:
            lines.append(f"tolerance        {simulation.tolerance:g} of the amplitude")
    lines += [_after(simulation, full=full), *map(_grown, simulation.growths)]
    return "\n".join(lines)


def _acting(effects: Sequence[Effect]) -> list[str]:
    """Return the effects with their sizes, and whether each is in the equation."""
    lines = ["effects          change of the motion, of the amplitude"]
    for effect in effects:
        unit = "" if effect.unit == "1" else f" {effect.unit}"
        size = "" if effect.predicted is None else f"{effect.predicted:.2g}{unit}"
        mark = "in " if effect.included else "out"
        lines.append(wrapped(f"  {mark}  {EFFECTS[effect.name]:<38} {size:>8}  {effect.why}", " " * 56))
    return lines


def _after(simulation: Simulation, *, full: bool) -> str:
    """Return method, step and errors; with ``full`` also the time."""
    solution, check, count = simulation.solution, simulation.check, simulation.count
    lines, steps = [f"method           {solution.integrator.words}"], f"{count} states"
    if solution.integrator.order:
        steps = f"{solution.parts * count} steps"
        limit = solution.integrator.stable_step(solution.problem)
        stability = f", unstable: the limit is {limit:.3g} s" if solution.step_s > limit else ""
        lines.append(f"step             {solution.step_s:.6g} s, {steps}{stability}")
    if solution.error is None or solution.velocity_error is None:
        lines.append(wrapped(f"predicted error  none: {solution.no_estimate}", " " * 17))
    else:
        lines.append(f"predicted error  {_errors(solution.error, solution.velocity_error)}")
    if check is not None:
        lines.append(f"measured error   {_errors(check.error, check.velocity_error)}, against {check.words}")
    if full:
        took = f"{simulation.choosing_s * 1e3:.2g} ms to choose, {solution.running_s * 1e3:.2g} ms to run"
        lines.append(f"cost             {took}, {steps}")
    return "\n".join(lines)


def _predicted(simulation: Simulation) -> str:
    """Return the motion in the quantities of Table 1."""
    predicted, seconds = prediction(simulation), float(simulation.trajectory.t[-1])
    if predicted is None:
        return "none: this start and drag give no oscillation"
    quality = "" if predicted["quality_factor"] is None else f", Q = {predicted['quality_factor']:.4g}"
    return (
        f"T = {predicted['period_s']:.6g} s, lambda = {predicted['damping_rate_per_s']:.4g} 1/s{quality} at A0 = "
        f"{predicted['amplitude_m']:.4g} m; A = {predicted['last_amplitude_m']:.4g} m after {seconds:.4g} s"
    )


def _grown(growth: Growth) -> str:
    """Say what a step of a method does to the amplitude, and from which step on the method fails."""
    measured = "" if growth.measured is None else f"; measured {growth.measured:.7f}"
    law = f"sqrt(1 + (w h)^2) = {growth.predicted:.7f}" if growth.predicted > 1.0 else "1"
    limit = f"with steps above {growth.fails_above_s:.3g} s" if growth.fails_above_s else "with any step, undamped,"
    return (
        f"{growth.words:<17}a step multiplies the amplitude by {law}{measured}\n"
        f"                 {limit} small swings grow"
    )


def _errors(position: float, velocity: float) -> str:
    if not math.isfinite(position):
        return "beyond all bounds"
    return f"{position:.2g} of the amplitude, {velocity:.2g} of the greatest velocity"
