"""``springmass trade``: what accuracy costs on this machine, as two tables."""

import json
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from springmass import __version__
from springmass.commands.given import GivenOptions
from springmass.commands.options import FileArgument, Json, ReadPairs
from springmass.commands.parameters import Positive, PositiveCount, argument, option
from springmass.errors import OK, UNREADABLE, ProgramError
from springmass.loading.options import AnalysisOptions
from springmass.loading.scenes import read_scene
from springmass.runs.run import Run
from springmass.terminal.progress import counted
from springmass.trade import (
    RECORD_DEFECTS,
    SCORED_QUANTITIES,
    TrueMotion,
    measure_integrators,
    measure_tiers,
    motion_of,
    motion_of_problem,
)


def trade(
    recording: Annotated[FileArgument | None, argument("INPUT", "take the motion from this recording")] = None,
    /,
    *,
    scene: Annotated[FileArgument | None, option("FILE", "scene of the recording, or take the motion from it")] = None,
    seeds: Annotated[PositiveCount, option("N", "simulated records of each kind (default: 20)")] = 20,
    seconds: Annotated[Positive, option("S", "length of the records without a recording, s (default: 60)")] = 60.0,
    as_json: Json = False,
    reading: ReadPairs = ReadPairs(),
    given: GivenOptions,
) -> int:
    """Simulate records of one motion, evaluate them with every tier, and solve the motion with every integrator."""
    if recording is not None:
        given.refuse("on the motion of a recording", "--seconds")
    else:
        given.only("without a recording", "--scene", "--seeds", "--seconds", "--json")
    motion = TrueMotion(seconds=seconds)
    given_scene = None if scene is None else read_scene(scene)
    if recording is not None:
        analysis = Run.of(recording, given_scene, AnalysisOptions(**reading.options.given())).analysis
        analysis.track.demand_length("a simulation of the motion")
        if (found := analysis.oscillation) is None:
            raise ProgramError(f"{recording}: {analysis.why}", "name a run that oscillates", UNREADABLE)
        motion = motion_of(analysis, found)
    elif given_scene is not None:
        from springmass.simulations.simulation import prepare

        ready = prepare(given_scene, seconds, where=str(scene))
        sigma = ready.stated.sensor_sigma_m
        motion = motion_of_problem(ready.problem, None if sigma is None else sigma.value, seconds)
    if not motion.seconds * motion.frequency_hz >= 2.0 or not motion.theta[0] > 0.0:
        raise ProgramError(
            f"expected a motion of two periods, got {motion.seconds:g} s at {motion.frequency_hz:.3g} Hz from "
            f"{motion.theta[0]:g} m",
            "take more --seconds, or state a start in the scene",
        )
    kinds = counted(measure_tiers(motion, seeds), len(RECORD_DEFECTS), "kinds of records")
    tiers = [row for rows in kinds for row in rows]
    problem = motion.problem()
    solved = [] if problem is None else [*measure_integrators(problem, 1.0 / motion.rate_hz, motion.t.size)]
    if as_json:
        truth = {**motion.truth(), "law": motion.law.name, "noise_m": motion.noise_m, "rate_hz": motion.rate_hz}
        facts = {"motion": {**truth, "seconds": motion.seconds}, "seeds": seeds, "tiers": tiers, "integrators": solved}
        print(json.dumps({"schema": 1, "kind": "simulated", **facts, "version": __version__}))
        return OK
    print(
        f"{seeds} records of {motion.seconds:.3g} s at {motion.rate_hz:.4g} Hz: {motion.frequency_hz:.5g} Hz, "
        f"{motion.theta[0] * 1e3:.3g} mm, noise {motion.noise_m * 1e3:.2g} mm, damping {motion.law.name}\n"
    )
    heads = ["record", "tier", "f / bound", "A / bound", "damping / bound", "time / ms", "failed"]
    print(_table(heads, [_tier(row) for row in tiers]))
    print()
    if not solved:
        print(f"no integrator solves the law {motion.law.name}; state another with [damping] law in a scene")
        return OK
    cells = [[r["method"], _setting(r), f"{r['error']:.1e}", str(r["steps"]), _ms(r)] for r in solved]
    print(_table(["integrator", "setting", "error / amplitude", "steps", "time / ms"], cells))
    return OK


def _tier(row: Mapping[str, Any]) -> list[str]:
    ratios = row["error_over_bound"]
    errors = [f"{ratios[each]:.3g}" if each in ratios else "-" for each in SCORED_QUANTITIES]
    return [row["record"], row["tier"], *errors, _ms(row), str(row["failed"] or "-")]


def _setting(row: Mapping[str, Any]) -> str:
    return f"{row['setting']}{', unstable' if row['unstable'] else ''}"


def _ms(row: Mapping[str, Any]) -> str:
    return "-" if row["time_s"] is None else f"{1e3 * row['time_s']:.3g}"


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return rows in columns: the first two to the left, numbers to the right."""
    widths = [max(map(len, column)) for column in zip(heads, *rows, strict=True)]
    form = "  ".join(f"{{:{'<' if i < 2 else '>'}{width}}}" for i, width in enumerate(widths))
    return "\n".join(form.format(*row).rstrip() for row in [heads, *rows])
