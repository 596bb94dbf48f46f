"""``springmass simulate``: the motion that a scene predicts, its uncertainty, and the cost of computing it."""

from __future__ import annotations

import json
import math
import shlex
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from acquisition.errors import visible
from pipeline.dynamics.band import Band, spread
from pipeline.dynamics.terms import required
from pipeline.errors import DynamicsError
from pipeline.results.effects import Effect, simulated_effects
from springmass.commands.options import Figures, File, flag, option, output
from springmass.errors import OK, USAGE, ProgramError, suggest, tell
from springmass.runs.options import How, ReadOptions
from springmass.runs.run import Run
from springmass.runs.scenes import ask_about, read_scene
from springmass.runs.simulating.prepared import Prepared, prepare
from springmass.runs.simulating.simulation import (
    Simulation,
    count_of,
    default_tolerance,
    demand_stable,
)
from springmass.runs.simulating.simulation import simulate as simulated
from springmass.runs.simulating.summaries import summary
from springmass.terminal.printing import wrapped
from springmass.values import Finite, NotNegative, Positive

FAR_BELOW = 0.01  # fraction of the band; a smaller tolerance gives no benefit
OF_OUTPUT = ("sensor", "noise_m", "echoes")


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class SimulateOptions:
    """The options of ``springmass simulate``."""

    scene: Annotated[File, option("S.toml", "scene file: masses, spring, start, damping")]
    method: Annotated[str, option("NAME", "integrator, or auto (default: auto)")] = "auto"
    dt: Annotated[Finite, option("S", "sampling interval and step of the solver, s (default: 0.01)")] = 0.01
    seconds: Annotated[Positive, option("N", "length of the simulation, s (default: 10)")] = 10.0
    tolerance: Annotated[
        Finite | None, option("E", "largest error relative to the amplitude (default: from the band)")
    ] = None
    check: Annotated[bool, flag("also measure the error; this takes longer than the simulation")] = False
    trade: Annotated[bool, flag("measure error and time of every method on this scene")] = False
    without: Annotated[
        tuple[Literal["drag", "disc", "spring-mass"], ...],
        option("EFFECT", "leave out an effect that the scene implies; may be repeated"),
    ] = ()
    force: Annotated[bool, flag("simulate even if the step is unstable")] = False
    against: Annotated[File | None, option("RUN", "measured run to compare with the prediction")] = None
    output: Annotated[File | None, output("RUN.h5", "write the readings of a rangefinder to a run file")] = None
    overwrite: Annotated[bool, flag("replace an existing RUN.h5")] = False
    sensor: Annotated[
        Literal["ideal", "rangefinder"] | None, option("NAME", "the sensor of RUN.h5 (default: rangefinder)")
    ] = None
    noise_m: Annotated[NotNegative | None, option("S", "noise of the sensor, m (default: from the scene, or 8e-5)")] = (
        None
    )
    echoes: Annotated[NotNegative | None, option("HZ", "false echoes per second (default: 0.1)")] = None
    seed: Annotated[int, option("N", "seed of the noise (default: 0)")] = 0
    folder: Annotated[
        File | None, option("DIR", "folder for NAME.simulated (default: here; with --json or -o: none)")
    ] = None
    figures: Figures = ()
    json: Annotated[bool, flag("print one JSON object on standard output")] = False


def simulate(*, options: SimulateOptions, read: ReadOptions = ReadOptions()) -> int:
    """Print what the scene implies, its uncertainty and the cost; solve the equation and write the output."""
    _demand(options)
    count = count_of(options.seconds, options.dt)
    scene, analysis = read_scene(options.scene), None
    ask_about(scene, options.scene)
    seconds, where = options.seconds, str(options.scene)
    if options.against is not None:
        from springmass.runs.simulating.against import duration_s

        analysis = Run.of(options.against, scene, How.of(read.given())).analysis
        seconds = max(seconds, duration_s(analysis))
    ready = prepare(scene, seconds, analysis=analysis, without=options.without, where=where)
    if ready.from_run:
        tell(f"from {options.against}: {', '.join(ready.from_run)}")
    if options.trade:
        from springmass.commands.trade import trade_of_scene

        return trade_of_scene(ready, where, options.dt, count, options.tolerance, options.folder, options.json)
    say = sys.stderr if options.json else sys.stdout
    band, of_band = _band(ready, seconds)
    tolerance, words = _tolerance(options, band)
    if not options.force:
        named_step = options.dt if options.tolerance is None else None
        demand_stable(ready.problem, options.method, named_step, where=where)
    terms = required(ready.problem, options.dt * count, tolerance)[1] if options.method == "auto" and tolerance else ()
    effects = simulated_effects(ready.stated, ready.problem, terms, options.dt * count, ready.drag, options.without)
    try:
        simulation = simulated(
            ready.problem,
            options.method,
            options.dt,
            count,
            tolerance,
            check=options.check,
            timer=time.perf_counter,
        )
    except DynamicsError as error:
        raise ProgramError(f"{options.scene}: {error}", USAGE) from error
    print(wrapped(f"band             {of_band}", " " * 17), file=sys.stderr)
    print(_before(words, effects), file=say)
    print(_after(simulation, count), file=say)
    against = None
    if analysis is not None:
        from springmass.runs.simulating.against import deviation_text, lay_over

        against = lay_over(analysis, ready.problem, options.method, options.dt, tolerance, band, ready.values())
        left = f"rms {against.rms_m * 1e3:.3g} mm, noise of a sample {against.noise_m * 1e3:.3g} mm"
        print("\n".join([f"against the run  {left}", *deviation_text(against)]), file=say)
    results = summary(simulation, against, band, effects, tolerance)
    if options.output is not None:
        _write_readings(ready, options, results)
    if options.folder is not None or not (options.json or options.output is not None):
        from springmass.runs.simulating.written import write_folder

        folder = write_folder(
            simulation, against, band, ready.solved, where, options.folder or ".", results, options.figures
        )
        print(f"written          {visible(str(folder))}", file=say)
        suggest(f"springmass analyse {shlex.quote(str(folder / 'run.h5'))} --scene {shlex.quote(str(options.scene))}")
    if options.json:
        print(json.dumps(results))
    return OK


def _demand(options: SimulateOptions) -> None:
    """Refuse combinations of options that make no sense."""
    if options.dt <= 0:
        raise ProgramError(f"--dt must be more than 0 s, got {options.dt:g}", USAGE)
    given = [f"--{name.replace('_', '-')}" for name in OF_OUTPUT if getattr(options, name) is not None]
    if given and options.output is None:
        raise ProgramError(f"{', '.join(given)}: of the readings in a run file, got none; add -o RUN.h5", USAGE)
    if options.sensor == "ideal" and len(given) > 1:
        raise ProgramError(f"--sensor ideal has neither noise nor echoes, got {', '.join(given[1:])}", USAGE)


def _band(ready: Prepared, seconds: float) -> tuple[Band | None, str]:
    """The band from the uncertain inputs and how it was computed, or the reason why there is none."""
    if not ready.values():
        return None, "none: the scene states no uncertainties"
    try:
        band = spread(ready.solved, seconds, ready.measured)
    except DynamicsError as error:
        return None, f"none: {error}"
    return band, f"{band.members} motions drawn from the uncertainties of {', '.join(band.quantities)}"


def _tolerance(options: SimulateOptions, band: Band | None) -> tuple[float | None, str]:
    """The tolerance, with words on its origin or a hint that it is far below the band."""
    if options.tolerance is None:
        if options.method != "auto":
            return None, ""
        found = default_tolerance(band)
        whence = "the default" if band is None else f"a hundredth of the band, {band.relative_u:.1g} of the amplitude"
        return found, f"tolerance        {found:.1g} of the amplitude: {whence}"
    found = float(options.tolerance)
    words = f"tolerance        {found:g} of the amplitude"
    if band is not None and 0.0 < found < 0.1 * FAR_BELOW * band.relative_u:
        turns = dict(zip(band.quantities, np.abs(band.of_log[:, -1].imag).tolist(), strict=True))
        name = max(turns, key=lambda each: turns[each])
        words += (
            f", far below the band: u({name}) alone is {turns[name]:.1g} rad after {band.t[-1]:.3g} s; "
            f"{default_tolerance(band):.0e} is enough here"
        )
    return found, words


def _before(tolerance: str, effects: Sequence[Effect]) -> str:
    """The effects that act, and the tolerance."""
    lines = ["effects          change of the motion, of the amplitude"]
    for effect in effects:
        size = "" if effect.predicted is None else f"{effect.predicted:.2g}"
        mark = "in " if effect.included else "out"
        lines.append(wrapped(f"  {mark}  {effect.name:<30} {size:>8}  {effect.why}", " " * 48))
    if tolerance:
        lines.append(wrapped(tolerance, " " * 17))
    return "\n".join(lines)


def _after(simulation: Simulation, count: int) -> str:
    """Method, step, errors and time."""
    solution, check = simulation.solution, simulation.check
    lines = [f"method           {solution.integrator.words}"]
    steps = f"{count} states"
    if solution.integrator.order:
        steps = f"{solution.parts * count} steps"
        lines.append(f"step             {solution.step_s:.6g} s, {steps}")
    if solution.error is None or solution.velocity_error is None:
        lines.append(wrapped(f"predicted error  none: {solution.no_estimate}", " " * 17))
    else:
        lines.append(f"predicted error  {_errors(solution.error, solution.velocity_error)}")
    if check is not None:
        lines.append(f"measured error   {_errors(check.error, check.velocity_error)}, against {check.words}")
    took = f"{simulation.choosing_s * 1e3:.2g} ms to choose, {solution.running_s * 1e3:.2g} ms to run"
    lines.append(f"price            {took}, {steps}")
    return "\n".join(lines)


def _errors(position: float, velocity: float) -> str:
    if not math.isfinite(position):
        return "beyond all bounds"
    return f"{position:.2g} of the amplitude, {velocity:.2g} of the greatest velocity"


def _write_readings(ready: Prepared, options: SimulateOptions, results: dict[str, object]) -> None:
    """Write the readings of a simulated rangefinder as a run of kind simulated."""
    from springmass.runs.simulating.written import write_readings

    assert options.output is not None
    path = Path(options.output)
    if path.exists() and not options.overwrite:
        raise ProgramError(f"{visible(str(path))}: exists; take another name, or --overwrite", USAGE)
    write_readings(
        path,
        ready,
        method=options.method,
        seconds=options.seconds,
        spacing_s=options.dt,
        sensor=options.sensor or "rangefinder",
        noise_m=options.noise_m,
        echoes_hz=options.echoes,
        seed=options.seed,
        where=str(options.scene),
        results=results,
    )
    say = sys.stderr if options.json else sys.stdout
    print(f"written          {visible(str(path))}", file=say)
    suggest(f"springmass analyse {shlex.quote(str(path))} --scene {shlex.quote(str(options.scene))}")
