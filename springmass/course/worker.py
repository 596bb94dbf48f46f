"""Turn a run into its row, or into its report: the work of every process, on this machine or another."""

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from acquisition.errors import visible
from acquisition.recordings.questions import Question
from pipeline.analyse import Analysis
from pipeline.bench.scene import PLACES
from pipeline.errors import AnalysisError
from pipeline.numerics.estimate import Estimate, UpperLimit
from pipeline.several.compare import SpringRun
from springmass.charts.several import LARGEST_DRAWN, drag_points, outline
from springmass.course.plan import digest_of, digests_of, software
from springmass.course.results_csv import ESTIMATES
from springmass.errors import internal_error
from springmass.report.html import SHARED
from springmass.result.advice import Harm, harm_of, sentence
from springmass.runs.run import Run
from springmass.runs.tasks import Failed, Task, analyse_all
from storage.errors import WriteFailed

Remedy = Callable[[Question], str]
"""Words how the user answers a question that a recording leaves open; a process of another machine imports it."""
DIGITS = 6  # decimal places of a correlation
TIME = "by springmass batch"  # in place of a time, so that a pass at any time gives the same bytes


def write_report_of(report: tuple[str, Task, Path], remedy: Remedy) -> str:
    """Write the report of a run, given by name, task and folder; return why it cannot be written, or nothing."""
    from springmass.report.write import write_report

    name, task, folder = report
    (run,) = analyse_all([task])
    if isinstance(run, Failed):
        return _line(task, run, remedy)
    try:
        recording = replace(run.loaded.recording, path=task.name)
        run = run.named(name, loaded=replace(run.loaded, recording=recording), time_utc=TIME)
        write_report(folder, [run], script=f"../../{SHARED}")
    except WriteFailed as error:
        return str(error)
    except Exception as error:  # a defect in the program must not stop the reports of other runs
        return f"{task.name}: {internal_error(error)}"
    return ""


def analyse_one(task: Task, remedy: Remedy) -> dict[str, Any]:
    """Return the row of a run, identical on every machine and at every time; a run that fails has one as well."""
    row = blank_row(task)
    row["input_sha256"] = digest_of(task.source) or None
    (run,) = analyse_all([task])
    if isinstance(run, Failed):
        return row | {"error": _line(task, run, remedy)}
    try:
        return row | row_of(run, task.name)
    except Exception as error:  # a defect in the program must not stop the other runs
        return row | {"error": f"{task.name}: {internal_error(error)}"}


def blank_row(task: Task, status: str = "failed", error: str = "") -> dict[str, Any]:
    """Return the row of a run for which only the task is known."""
    return {
        "path": task.name,
        "status": status,
        "error": error,
        "errors": 0,
        "warnings": 0,
        **digests_of(task),
        "software": software(),
        "tell": [],  # what the group should know: each harmful finding with its advice, the worst first
        "thumbnail": "",
    }


def _line(task: Task, failed: Failed, remedy: Remedy) -> str:
    """Return why there is no run, in one line that names it as the inputs do."""
    asked = failed.question
    message = str(failed.error) if asked is None else str(asked.with_remedy(remedy(asked.question)))
    line = " ".join(message.replace(task.source, task.name).split())
    return line if task.name in line else f"{task.name}: {line}"


def row_of(run: Run, path: str) -> dict[str, Any]:
    """Return the columns of an analysed run; errors name its path as the inputs do."""
    loaded, analysis, findings = run.loaded, run.analysis, run.findings
    track, scene = analysis.track, analysis.scene
    by_harm = sorted(((harm_of(f.code, f.severity), f) for f in findings), key=lambda pair: pair[0])
    return {
        **_damping(analysis),
        **_numbers(analysis.estimates),
        **_numbers({name: x for name in PLACES if (x := getattr(scene, name)) is not None}),
        **analysis.quality,
        "malformed_rows": loaded.recording.malformed_rows,
        "status": "ok" if run.ok else "no_oscillation",
        "error": "" if run.ok else f"{path}: no oscillation: {run.why}",
        "format": loaded.format,
        "kind": loaded.info.kind,
        "channel": loaded.channel or None,
        "unit": track.unit,
        "start_time": loaded.provenance.get("start_time"),
        "clock": track.clock,
        "samples": len(track),
        "rate_hz": _number(track.rate_hz),
        "duration_s": _number(track.t[-1] - track.t[0]) if len(track) else 0.0,
        "errors": sum(f.severity == "error" for f in findings),
        "warnings": sum(f.severity == "warning" for f in findings),
        "findings": _json([f.code for f in findings]),
        "messages": _json([[f.severity, visible(f.message)] for f in findings if f.severity != "info"]),
        "tell": [f"{sentence(f.message)} {f.advice}".rstrip() for harm, f in by_harm if harm <= Harm.PART],
        "thumbnail": outline(analysis),
    }


def _damping(analysis: Analysis) -> dict[str, Any]:
    damping, derived = analysis.damping, analysis.derived
    if not damping.fits:
        return {}
    undetermined = [name for name, x in derived.coefficients.items() if isinstance(x, UpperLimit)]
    matrix = [[_number(x) for x in line] for line in derived.joint.correlation.round(DIGITS).tolist()]
    row = _numbers(derived.coefficients) | {
        "law": damping.selected,
        "admissible": " ".join(damping.admissible),
        "stated_law": damping.stated or None,
        "one_law": derived.law or None,
        "undetermined": " ".join(undetermined) or None,
        "reduced_chi2": _number(damping.best.reduced_chi2),
        "correlations": _json({"names": list(derived.joint.names), "matrix": matrix}),
        "drag_points": _json(drag_points(analysis)),
        "disc_damping_rate": next(
            (_number(x.predicted) for x in analysis.effects if x.name == "disc_drag" and x.predicted is not None), None
        ),
    }
    try:
        spring = SpringRun.of("", derived, clock=analysis.track.clock)
    except AnalysisError:
        return row  # without a mass, no spring constant can be compared
    of_spring = {"natural_angular_frequency": spring.angular_frequency, "own_mass_kg": spring.mass_kg}
    return row | {"u_clock": _number(spring.u_clock)} | _numbers(of_spring)


def _numbers(estimates: Mapping[str, Estimate]) -> dict[str, float | None]:
    shown = {name: x for name, x in estimates.items() if name in (*ESTIMATES, *PLACES)}
    return {f"{name}{end}": _number(y) for name, x in shown.items() for end, y in (("", x.value), ("_u", x.u))}


def _number(x: Any) -> float | None:
    return float(x) if math.isfinite(x) and abs(x) <= LARGEST_DRAWN else None


def _json(value: Any) -> str | None:
    """Return canonical JSON in one line; None for what is empty."""
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"), sort_keys=True) if value else None
