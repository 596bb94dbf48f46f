"""``springmass compare``: do several runs agree on one spring, and does one damping law hold across them?"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from pipeline.bench.scene import Scene
from springmass import __version__
from springmass.commands import completions
from springmass.errors import OK, REJECTED, USAGE, ProgramError, complain
from springmass.runs.analysing import Analysed, analyse_loaded, distinct_names, make_folder, now_utc
from springmass.runs.comparing import Compared, compare_analysed, comparison_json, demand_one_spring
from springmass.runs.loading import Loaded, load, read_scene

__all__ = ["run"]


def run(options: argparse.Namespace) -> int:
    """Analyse every run, compare them, print or write what was found."""
    if len(options.input) < 2:
        raise ProgramError(
            f"compare needs two runs at least, got {len(options.input)}; springmass analyse takes a single one", USAGE
        )
    names = distinct_names(options.input)
    # Scenes first: what is wrong with them is known before an hour of records is read.
    given = _given_scenes(options)
    out = None if options.out is None else make_folder(options.out)
    cut = {"from_s": options.from_s, "to_s": options.to_s}
    loaded = [load(path, **completions(options), **cut) for path in options.input]
    scenes = [_scene(one, scene) for one, scene in zip(loaded, given, strict=True)]
    demand_one_spring(list(zip(names, scenes, strict=True)))
    time_utc = now_utc()
    parameters = _parameters(options)
    analysed = [
        analyse_loaded(one, scene, parameters=parameters, accuracy=options.accuracy, time_utc=time_utc)
        for one, scene in zip(loaded, scenes, strict=True)
    ]
    named = list(zip(names, analysed, strict=True))
    compared = compare_analysed(named, mass_correlation=options.mass_correlation)
    provenance = {
        "version": __version__,
        "accuracy": options.accuracy,
        "parameters": parameters,
        "time_utc": time_utc,
    }
    result = comparison_json(compared, named, provenance)
    if options.json:
        print(json.dumps(result, allow_nan=False), flush=True)
    else:
        _print_text(compared, named, result)
    if out is not None:
        _write(out, compared, named, result)
    wrong = [f"{f['code']}" for f in _all_findings(result) if f["severity"] == "error"]
    if options.strict and wrong:
        complain(f"rejected under --strict: {', '.join(dict.fromkeys(wrong))}")
        return REJECTED
    return OK


def _given_scenes(options: argparse.Namespace) -> list[Scene | None]:
    """One scene a run; None where the run's own is to be taken."""
    count = len(options.input)
    if len(options.scene) not in (0, 1, count):
        raise ProgramError(
            f"--scene was given {len(options.scene)} times for {count} runs; give it once for all of them, "
            "or once for each in their order",
            USAGE,
        )
    scenes: list[Scene | None] = [read_scene(path) for path in options.scene] or [None]
    return scenes * count if len(scenes) == 1 else scenes


def _scene(loaded: Loaded, given: Scene | None) -> Scene:
    if given is not None:
        return given
    return Scene.from_mapping(loaded.scene or {}, where=f"{loaded.path} (its scene)")


def _print_text(compared: Compared, named: list[tuple[str, Analysed]], result: dict[str, Any]) -> None:
    from springmass.printing import comparison_text, findings_text, wrapped

    print(comparison_text(compared.comparison, [analysed.analysis for _, analysed in named]))
    for joint in compared.joint:
        print(f"\n{wrapped(joint.message)}")
    for (name, _), one in zip(named, result["runs"], strict=True):
        grave = [f for f in one["findings"] if f["severity"] != "info"]
        if grave:
            print(f"\n{name}:")
            print(findings_text(grave))


def _write(out: Path, compared: Compared, named: list[tuple[str, Analysed]], result: dict[str, Any]) -> None:
    from springmass.report.write import ReportRun, write_report

    report = write_report(
        out,
        [ReportRun(name, analysed.analysis, analysed.result["input"]) for name, analysed in named],
        comparison=compared.comparison,
        joint=compared.joint,
        summary=result,
        provenance=result["provenance"],
        results=result["runs"],
    )
    print(f"report: {report}", file=sys.stderr)


def _all_findings(result: dict[str, Any]) -> list[dict[str, Any]]:
    return [*result["findings"], *(f for one in result["runs"] for f in one["findings"])]


def _parameters(options: argparse.Namespace) -> dict[str, Any]:
    names = ("accuracy", "mass_correlation", "channel", "run", "rate_hz", "unit", "from_s", "to_s", "strict")
    return {name: getattr(options, name) for name in names}
