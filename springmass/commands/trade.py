"""``springmass trade``: what accuracy costs on this machine, measured, in a table and drawn."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.errors import DynamicsError
from springmass import __version__
from springmass.commands import load_for
from springmass.errors import OK, USAGE, ProgramError
from springmass.runs.analysing import make_folder
from springmass.runs.scenes import read_scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from springmass.runs.simulating.prepared import Prepared

__all__ = ["run", "trade_of_scene"]

SIMULATED = ("seeds", "noise_m", "seconds", "damping", "echoes", "out")
SPACING_S, LONG_S = 0.01, 120.0  # of the samples of a scene's motion, and how long it is unless it is said
LABELS = {
    "frequency": "frequency: error / bound",
    "amplitude": "amplitude: error / bound",
    "damping_rate": "damping: error / bound",
}


def run(options: argparse.Namespace) -> int:
    """Measure estimators on simulated records, or put one record before all of them."""
    if options.integrators:
        return _integrators(options)
    if given := _given(options, ("scene", "tolerance")):
        raise ProgramError(f"{', '.join(given)}: of --integrators, which was not asked for; add it", USAGE)
    if options.hostile:
        return _hostile(options)
    if options.input is None:
        return _simulated(options)
    if given := _given(options, SIMULATED):
        flags = ", ".join(f"--{name}" for name in given)
        raise ProgramError(
            f"{flags}: describes simulated records, got the record {options.input}; give one of both", USAGE
        )
    return _own(options)


def _simulated(options: argparse.Namespace) -> int:
    from springmass.trade.measure import measure
    from springmass.trade.methods import methods
    from springmass.trade.summary import trade_json, trade_text
    from springmass.trade.truth import Truth

    asked = {
        "noise_m": options.noise_m,
        "seconds": options.seconds,
        "damping_per_s": options.damping,
        "echoes": options.echoes,
    }
    truth = Truth(**{name: value for name, value in asked.items() if value is not None})
    if truth.seconds * truth.frequency_hz < 2.0:
        raise ProgramError(
            f"--seconds: two periods of {1 / truth.frequency_hz:.3g} s are needed, got {truth.seconds:g} s", USAGE
        )
    seeds = 100 if options.seeds is None else options.seeds
    out = None if options.out is None else make_folder(options.out)
    found, absent = methods()
    trade = measure(truth, found, seeds, timer=time.perf_counter, progress=_progress(seeds))
    content = trade_json(trade, absent, __version__)
    if out is not None:
        from springmass.trade.drawing import trade_figure

        _write(out, "trade", trade_figure({q: trade.points(q) for q in trade.bound}, labels=LABELS), content)
    print(json.dumps(content) if options.json else trade_text(trade, absent))
    return OK


def _given(options: argparse.Namespace, names: Sequence[str]) -> list[str]:
    """Return which of some options were given, as they are spelt."""
    return [name.replace("_", "-") for name in names if getattr(options, name) is not None]


def _hostile(options: argparse.Namespace) -> int:
    if given := _given(options, ("input", *SIMULATED[1:])):
        raise ProgramError(
            f"--hostile measures records of its own and takes only --seeds and --json; got {', '.join(given)}", USAGE
        )
    from springmass.trade.measure import measure
    from springmass.trade.methods import presets
    from springmass.trade.summary import hostile_json, hostile_text
    from springmass.trade.truth import HOSTILE

    seeds = 20 if options.seeds is None else options.seeds
    trades = {}
    for name, truth in HOSTILE.items():
        trades[name] = measure(truth, presets(), seeds, timer=time.perf_counter, progress=_progress(seeds, name))
    print(json.dumps(hostile_json(trades, __version__)) if options.json else hostile_text(trades))
    return OK


def _integrators(options: argparse.Namespace) -> int:
    if options.scene is not None:
        if given := _given(options, ("input", *(name for name in SIMULATED if name not in ("seconds", "out")))):
            raise ProgramError(
                f"--integrators --scene takes only --seconds, --tolerance, --out and --json; got {', '.join(given)}",
                USAGE,
            )
        from springmass.runs.simulating.prepared import prepare
        from springmass.runs.simulating.simulation import count_of

        seconds = LONG_S if options.seconds is None else options.seconds
        count = count_of(seconds, SPACING_S)
        ready = prepare(read_scene(options.scene), seconds, where=options.scene)
        return trade_of_scene(ready, options.scene, SPACING_S, count, options.tolerance, options.out, options.json)
    if given := _given(options, ("input", *SIMULATED[:-1], "tolerance")):
        names = ", ".join(given)
        raise ProgramError(f"--integrators measures trajectories and takes only --out and --json; got {names}", USAGE)
    from springmass.trade.integrators import integrators_figure, integrators_json, integrators_text, measure_integrators

    out = None if options.out is None else make_folder(options.out)
    rows = measure_integrators(time.perf_counter, progress=lambda scene: print(f"trade: {scene}", file=sys.stderr))
    content = integrators_json(rows, __version__)
    if out is not None:
        _write(out, "integrators", integrators_figure(rows), content)
    print(json.dumps(content) if options.json else integrators_text(rows))
    return OK


def trade_of_scene(
    ready: Prepared, where: str, spacing_s: float, count: int, tolerance: float | None, out: str | None, as_json: bool
) -> int:
    """Measure error against time of every method on one scene, and recommend one."""
    from springmass.runs.simulating.recommend import wanted_error
    from springmass.trade.integrators import (
        integrators_figure,
        integrators_json,
        integrators_text,
        measure_scene,
        recommended,
    )

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
    from springmass.report.figures import KINDS, save
    from storage.atomic import write_whole
    from storage.folder import whole_folder

    last = f"{name}.json"
    with whole_folder(out, {last, *(f"{name}.{kind}" for kind in KINDS)}, last) as folder:
        save(figure, folder, name)
        write_whole(folder / last, json.dumps(content, indent=2) + "\n")


def _own(options: argparse.Namespace) -> int:
    from springmass.trade.measure import own_record
    from springmass.trade.methods import methods
    from springmass.trade.summary import own_json, own_text

    loaded = load_for(options, options.input)
    loaded.track.demand_length("a comparison of estimators")
    found, absent = methods()
    results = own_record(loaded.track, found, timer=time.perf_counter)
    if options.json:
        print(json.dumps(own_json(options.input, results, absent, __version__)))
    else:
        print(own_text(options.input, results))
        for each in absent:
            print(f"Not measured: {each.name}, {each.needs} is not installed.")
    return OK


def _progress(total: int, what: str = "trade") -> Callable[[int], None]:
    """Return a counter on a terminal's stderr, silent where stderr is a file."""

    def tell(done: int) -> None:
        if sys.stderr.isatty():
            end = "\r" if done < total else "\n"
            print(f"{what}: record {done} of {total}", end=end, file=sys.stderr, flush=True)

    return tell
