"""``springmass trade``: measure the cost of accuracy on this machine; print a table and draw it."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from pipeline.errors import DynamicsError
from springmass import __version__
from springmass.commands.options import File, argument, flag, option, output
from springmass.errors import OK, USAGE, ProgramError, manner
from springmass.runs.loading import load
from springmass.runs.options import ReadOptions
from springmass.runs.outputs import make_folder
from springmass.runs.scenes import read_scene
from springmass.terminal.progress import TaskProgress, counted
from springmass.values import Count, NotNegative, Positive, SampleShare

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from springmass.runs.simulating.prepared import Prepared

SIMULATED = ("seeds", "noise_m", "seconds", "damping", "echoes", "output")
SPACING_S, LONG_S = 0.01, 120.0  # sample spacing and default duration of a scene's motion


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class TradeOptions:
    """The options of ``springmass trade``."""

    seeds: Annotated[Count | None, option("N", "number of simulated recordings (default: 100; with --hostile: 20)")] = (
        None
    )
    noise_m: Annotated[Positive | None, option("S", "noise of the recordings, m (default: 0.0003)")] = None
    seconds: Annotated[Positive | None, option("N", "length of the recordings, s (default: 120)")] = None
    damping: Annotated[NotNegative | None, option("G", "linear damping of the recordings, 1/s (default: 0.01463)")] = (
        None
    )
    echoes: Annotated[SampleShare | None, option("X", "share of false echoes, 0 to 0.4 (default: 0)")] = None
    hostile: Annotated[bool, flag("measure the accuracies on difficult recordings")] = False
    integrators: Annotated[bool, flag("measure the integrators instead: error and time")] = False
    scene: Annotated[File | None, option("S.toml", "with --integrators: measure only the motion of this scene")] = None
    tolerance: Annotated[Positive | None, option("E", "with --scene: error to recommend a method for")] = None
    output: Annotated[File | None, output("DIR", "folder for trade.svg, trade.pdf and trade.json")] = None
    json: Annotated[bool, flag("print one JSON object on standard output")] = False


def trade(
    recording: Annotated[File | None, argument("INPUT", "measure all methods on this recording instead")] = None,
    /,
    *,
    options: TradeOptions = TradeOptions(),
    read: ReadOptions = ReadOptions(),
) -> int:
    """Measure estimators on simulated recordings, or apply all of them to one recording."""
    if options.integrators:
        return _integrators(recording, options)
    if given := _given(options, ("scene", "tolerance")):
        raise ProgramError(f"{', '.join(given)}: of --integrators, which was not asked for; add it", USAGE)
    if options.hostile:
        return _hostile(recording, options)
    if recording is None:
        return _simulated(options)
    if given := _given(options, SIMULATED):
        flags = ", ".join(f"--{name}" for name in given)
        raise ProgramError(f"{flags}: describes simulated records, got the record {recording}; give one of both", USAGE)
    return _own(recording, options, read)


def _simulated(options: TradeOptions) -> int:
    from springmass.trade.measure import measure
    from springmass.trade.methods import references, tiers
    from springmass.trade.tables import trade_json, trade_text
    from springmass.trade.truth import Truth

    given = {
        "noise_m": options.noise_m,
        "seconds": options.seconds,
        "damping_per_s": options.damping,
        "echoes": options.echoes,
    }
    truth = Truth(**{name: value for name, value in given.items() if value is not None})
    if truth.seconds * truth.frequency_hz < 2.0:
        raise ProgramError(
            f"--seconds: two periods of {1 / truth.frequency_hz:.3g} s are needed, got {truth.seconds:g} s", USAGE
        )
    seeds = 100 if options.seeds is None else options.seeds
    out = None if options.output is None else make_folder(options.output)
    with TaskProgress("records", seeds, quiet=manner()[0]) as progress:
        trade = measure(
            truth, [*tiers(linear=True), *references()], seeds, timer=time.perf_counter, progress=progress.update
        )
    content = trade_json(trade, __version__)
    if out is not None:
        from springmass.trade.drawing import trade_figure

        _write(out, "trade", trade_figure(trade), content)
    print(json.dumps(content) if options.json else trade_text(trade))
    return OK


def _given(options: TradeOptions, names: Sequence[str]) -> list[str]:
    """Return which of some options were given, as they are spelt."""
    return [name.replace("_", "-") for name in names if getattr(options, name) is not None]


def _named(recording: str | Path | None) -> list[str]:
    return [] if recording is None else [f"the record {recording}"]


def _hostile(recording: str | Path | None, options: TradeOptions) -> int:
    if given := [*_named(recording), *_given(options, SIMULATED[1:])]:
        raise ProgramError(
            f"--hostile simulates its recordings and takes only --seeds and --json; got {', '.join(given)}", USAGE
        )
    from springmass.trade.measure import measure
    from springmass.trade.methods import tiers
    from springmass.trade.tables import hostile_json, hostile_text
    from springmass.trade.truth import HOSTILE

    seeds = 20 if options.seeds is None else options.seeds
    kinds = counted(HOSTILE.items(), len(HOSTILE), "kinds of records", quiet=manner()[0])
    trades = {name: measure(truth, tiers(), seeds, timer=time.perf_counter) for name, truth in kinds}
    print(json.dumps(hostile_json(trades, __version__)) if options.json else hostile_text(trades))
    return OK


def _integrators(recording: str | Path | None, options: TradeOptions) -> int:
    if options.scene is not None:
        others = [name for name in SIMULATED if name not in ("seconds", "output")]
        if given := [*_named(recording), *_given(options, others)]:
            raise ProgramError(
                f"--integrators --scene takes only --seconds, --tolerance, -o and --json; got {', '.join(given)}",
                USAGE,
            )
        from springmass.runs.simulating.prepared import prepare
        from springmass.runs.simulating.simulation import count_of

        seconds = LONG_S if options.seconds is None else options.seconds
        count = count_of(seconds, SPACING_S)
        ready = prepare(read_scene(options.scene), seconds, where=str(options.scene))
        return trade_of_scene(
            ready, str(options.scene), SPACING_S, count, options.tolerance, options.output, options.json
        )
    if given := [*_named(recording), *_given(options, (*SIMULATED[:-1], "tolerance"))]:
        names = ", ".join(given)
        raise ProgramError(f"--integrators measures trajectories and takes only -o and --json; got {names}", USAGE)
    from springmass.trade.drawing import integrators_figure
    from springmass.trade.integrators import SCENES, integrators_json, integrators_text, measure_integrators

    out = None if options.output is None else make_folder(options.output)
    with TaskProgress("scenes", len(SCENES), quiet=manner()[0]) as progress:
        rows = measure_integrators(time.perf_counter, progress=progress.update)
    content = integrators_json(rows, __version__)
    if out is not None:
        _write(out, "integrators", integrators_figure(rows), content)
    print(json.dumps(content) if options.json else integrators_text(rows))
    return OK


def trade_of_scene(
    ready: Prepared,
    where: str,
    spacing_s: float,
    count: int,
    tolerance: float | None,
    out: str | Path | None,
    as_json: bool,
) -> int:
    """Measure error against time of every method on one scene, and recommend one."""
    from springmass.runs.simulating.recommend import wanted_error
    from springmass.trade.drawing import integrators_figure
    from springmass.trade.integrators import integrators_json, integrators_text, measure_scene, recommended

    folder = None if out is None else make_folder(out)
    name = Path(where).name.removesuffix(".toml")
    try:
        rows = measure_scene(name, ready.problem, spacing_s, count, time.perf_counter)
    except DynamicsError as error:
        raise ProgramError(f"{where}: {error}", USAGE) from error
    wanted, whence = wanted_error(ready, spacing_s * count, tolerance)
    best = recommended(rows, wanted)
    way = f"{best.method}, {best.setting}" if best.tolerance is None else f"auto --tolerance {best.tolerance:g}"
    kept = "" if best.error <= wanted else "; none keeps it, this comes nearest"
    words = f"{way}: error {best.error:.1e} in {best.seconds * 1e3:.3g} ms, for {wanted:.1e}, {whence}{kept}"
    content = integrators_json(rows, __version__)
    content["recommended"] = {
        "method": best.method,
        "setting": best.setting,
        "auto_tolerance": best.tolerance,
        "error": best.error,
        "seconds": best.seconds,
        "wanted": wanted,
        "why": whence,
    }
    if folder is not None:
        label = f"time for {spacing_s * count:g} s at {1.0 / spacing_s:g} Hz / ms"
        _write(folder, "integrators", integrators_figure(rows, label), content)
    if as_json:
        print(json.dumps(content))
    else:
        print(integrators_text(rows))
        print(f"\nrecommended: {words}")
    return OK


def _write(out: Path, name: str, figure: Figure, content: Mapping[str, Any]) -> None:
    from springmass.charts.draw import style, written
    from storage.atomic import write_whole
    from storage.folder import whole_folder

    last = f"{name}.json"
    with whole_folder(out, {last, *(f"{name}.{kind}" for kind in ("svg", "pdf"))}, last) as folder:
        with style():
            for kind in ("svg", "pdf"):
                write_whole(folder / f"{name}.{kind}", written(figure, kind))
        write_whole(folder / last, json.dumps(content, indent=2) + "\n")


def _own(recording: str | Path, options: TradeOptions, read: ReadOptions) -> int:
    from springmass.trade.measure import own_record
    from springmass.trade.methods import references, tiers
    from springmass.trade.tables import own_json, own_text

    loaded = load(recording, read)
    loaded.track.demand_length("a comparison of estimators")
    results = own_record(loaded.track, [*tiers(linear=True), *references()], timer=time.perf_counter)
    if options.json:
        print(json.dumps(own_json(str(recording), results, __version__)))
    else:
        print(own_text(str(recording), results))
    return OK
