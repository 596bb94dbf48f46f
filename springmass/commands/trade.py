"""``springmass trade``: what accuracy costs on this machine, measured, in a table and drawn."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable

from springmass import __version__
from springmass.commands import completions
from springmass.errors import OK, USAGE, ProgramError
from springmass.runs.analysing import make_folder

__all__ = ["run"]

SIMULATED = ("seeds", "noise_m", "seconds", "damping", "echoes", "out")
LABELS = {
    "frequency": "frequency: error / bound",
    "amplitude": "amplitude: error / bound",
    "damping_rate": "damping: error / bound",
}


def run(options: argparse.Namespace) -> int:
    """Measure estimators on simulated records, or put one record before all of them."""
    if options.integrators:
        return _integrators(options)
    if options.input is None:
        return _simulated(options)
    given = [
        name for name in ("seeds", "noise_m", "seconds", "damping", "echoes") if getattr(options, name) is not None
    ]
    if given or options.out is not None:
        flags = ", ".join("--" + name.replace("_", "-") for name in [*given, *(["out"] if options.out else [])])
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
        from springmass.report.figures import render
        from springmass.trade.drawing import trade_figure
        from storage.atomic import write_whole

        figure = trade_figure({q: trade.points(q) for q in trade.bound}, labels=LABELS)
        write_whole(out / "trade.svg", render(figure, "svg"))
        write_whole(out / "trade.pdf", render(figure, "pdf"))
        write_whole(out / "trade.json", json.dumps(content, indent=2) + "\n")
    print(json.dumps(content) if options.json else trade_text(trade, absent))
    return OK


def _integrators(options: argparse.Namespace) -> int:
    given = [name for name in ("input", *SIMULATED[:-1]) if getattr(options, name) is not None]
    if given:
        names = ", ".join(name.replace("_", "-") for name in given)
        raise ProgramError(f"--integrators measures trajectories and takes only --out and --json; got {names}", USAGE)
    from springmass.trade.integrators import integrators_figure, integrators_json, integrators_text, measure_integrators

    out = None if options.out is None else make_folder(options.out)
    rows = measure_integrators(time.perf_counter, progress=lambda scene: print(f"trade: {scene}", file=sys.stderr))
    content = integrators_json(rows, __version__)
    if out is not None:
        from springmass.report.figures import render
        from storage.atomic import write_whole

        figure = integrators_figure(rows)
        write_whole(out / "integrators.svg", render(figure, "svg"))
        write_whole(out / "integrators.pdf", render(figure, "pdf"))
        write_whole(out / "integrators.json", json.dumps(content, indent=2) + "\n")
    print(json.dumps(content) if options.json else integrators_text(rows))
    return OK


def _own(options: argparse.Namespace) -> int:
    from springmass.runs.loading import load
    from springmass.trade.measure import own_record
    from springmass.trade.methods import methods
    from springmass.trade.summary import own_json, own_text

    loaded = load(options.input, **completions(options))
    found, absent = methods()
    results = own_record(loaded.track, found, timer=time.perf_counter)
    if options.json:
        print(json.dumps(own_json(options.input, results, absent, __version__)))
    else:
        print(own_text(options.input, results))
        for each in absent:
            print(f"Not measured: {each.name}, {each.needs} is not installed.")
    return OK


def _progress(total: int) -> Callable[[int], None]:
    """Return a counter on a terminal's stderr, silent where stderr is a file."""

    def tell(done: int) -> None:
        if sys.stderr.isatty():
            end = "\r" if done < total else "\n"
            print(f"trade: record {done} of {total}", end=end, file=sys.stderr, flush=True)

    return tell
