"""Turn a run into its row, or into its report: the work of every process, on this machine or another."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.errors import AcquisitionError, NeedsAnswer, visible
from pipeline.analyse import Analysis, Oscillation, Overdamped
from pipeline.bench.scene import PLACES, Scene
from pipeline.errors import AnalysisError, PipelineError
from pipeline.numerics.estimate import Estimate, UpperLimit
from pipeline.numerics.threads import one_thread
from pipeline.results.compare import SpringRun
from pipeline.track import F8
from springmass.batch.plan import Job, code_sha256, digest_of
from springmass.batch.rows import ESTIMATES
from springmass.errors import NO_MEMORY, ProgramError, internal_error, quietly
from springmass.report.advice import Harm, harm_of, sentence
from springmass.report.script import SHARED
from springmass.runs.analysing import AnalysedRun, load_and_analyse
from springmass.runs.options import ReadOptions
from springmass.runs.questions import for_course
from storage.errors import StorageError

LARGEST = 1e100
"""Maximum magnitude of numbers in a row, whose square is still finite. Larger estimates are left out."""
BINS, FEWEST_BINS = 60, 8  # maximum and minimum number of bins in a thumbnail
DRAG_POINTS = 8
DIGITS = 6  # decimal places of a correlation
TIME = "by springmass batch"  # in place of a time, so that a pass at any time gives the same bytes


def analyse_job(job: Job) -> AnalysedRun:
    """Read a run of a course and analyse it with the scene and options of its job."""
    options = ReadOptions.of(job.answers)
    if options.velocity is not None:
        options = replace(options, velocity=job.whole(str(options.velocity)))
    scene = None if job.scene is None else Scene.from_mapping(job.scene)
    return load_and_analyse(job.whole(job.path), options, scene, accuracy=job.accuracy, law=job.law)


def write_reports(tasks: Sequence[tuple[str, Job, Path]]) -> list[str]:
    """Write the reports of runs, given by name, job and folder; return a reason for each that cannot be written."""
    return [_attempt(task[1], partial(_write_report, *task)) for task in tasks]


def _write_report(name: str, job: Job, folder: Path) -> None:
    from springmass.report.write import write_report

    with quietly():
        stated = {**job.answers, "accuracy": job.accuracy, "law": job.law}
        run = analyse_job(job).described(stated, name=name, time_utc=TIME)
    result = {**run.result, "input": {**run.result["input"], "path": job.path}}
    write_report(folder, [replace(run, result=result)], script=f"../../{SHARED}")


def analyse_many(jobs: Sequence[Job]) -> list[dict[str, Any]]:
    """Return the rows of runs, identical on every machine and at every time; a run that fails has one as well."""
    # Messages about a recording go into its row. Threads are limited once instead of in every analysis.
    with quietly(), one_thread:
        return [_analyse_one(job) for job in jobs]


def blank_row(job: Job, status: str = "failed", error: str = "") -> dict[str, Any]:
    """Return the row of a run for which only the job is known."""
    return {
        "path": job.path,
        "status": status,
        "error": error,
        "errors": 0,
        "warnings": 0,
        "scene_sha256": job.scene_sha256,
        "parameters_sha256": job.parameters_sha256,
        "code_sha256": code_sha256(),
        "tell": [],  # what the group should know: each harmful finding with its advice, the worst first
        "thumbnail": "",
    }


def _analyse_one(job: Job) -> dict[str, Any]:
    row = blank_row(job)
    row["input_sha256"] = digest_of(job.whole(job.path)) or None
    failure = _attempt(job, lambda: _fill(row, analyse_job(job)))
    return row | {"error": failure} if failure else row


def _attempt(job: Job, do: Callable[[], None]) -> str:
    """Return why something could not be done, in one line that names the run as the inputs do; empty if it could."""
    try:
        do()
        return ""
    except NeedsAnswer as error:
        message = str(error.with_remedy(for_course(error.question)))
    except (ProgramError, AcquisitionError, PipelineError, StorageError, OSError) as error:
        message = str(error)
    except MemoryError:
        message = NO_MEMORY
    except Exception as error:  # a defect in the program must not stop the other runs
        message = internal_error(error)
    line = " ".join(message.replace(job.whole(job.path), job.path).split())
    return line if job.path in line else f"{job.path}: {line}"


def _fill(row: dict[str, Any], run: AnalysedRun) -> None:
    loaded, analysis = run.loaded, run.analysis
    track, motion, findings = analysis.track, analysis.motion, analysis.findings
    moves = isinstance(motion, (Oscillation, Overdamped))
    by_harm = sorted(((harm_of(f.code, f.severity), f) for f in findings), key=lambda pair: pair[0])
    row |= {
        "format": loaded.format,
        "kind": loaded.info.kind,
        "channel": loaded.channel or None,
        "unit": track.unit,
        "start_time": loaded.provenance.get("start_time"),
        "clock": track.clock,
        "samples": len(track),
        "rate_hz": _number(track.rate_hz),
        "duration_s": _number(track.t[-1] - track.t[0]) if len(track) else 0.0,
        **_numbers(analysis.estimates),
        **{f"{name}{end}": value for name in PLACES if (x := getattr(analysis.scene, name)) is not None
           for end, value in (("", x.value), ("_u", x.u))},
        **analysis.quality,
        "malformed_rows": loaded.malformed_rows,
        "errors": sum(f.severity == "error" for f in findings),
        "warnings": sum(f.severity == "warning" for f in findings),
        "findings": _json([f.code for f in findings]),
        "messages": _json([[f.severity, visible(f.message)] for f in findings if f.severity != "info"]),
        "tell": [f"{sentence(f.message)} {f.advice}".rstrip() for harm, f in by_harm if harm <= Harm.PART],
        "thumbnail": _thumbnail(track.t, track.y, _period_s(analysis)),
    }  # fmt: skip
    if isinstance(motion, Oscillation):
        _fill_damping(row, analysis, motion)
    row["status"] = "ok" if moves else "no_oscillation"
    row["error"] = "" if moves else f"{row['path']}: no oscillation: {motion.why}"


def _fill_damping(row: dict[str, Any], analysis: Analysis, motion: Oscillation) -> None:
    damping, derived = motion.damping, motion.derived
    undetermined = [name for name, x in derived.coefficients.items() if isinstance(x, UpperLimit)]
    matrix = [[_number(x) for x in line] for line in derived.joint.correlation.round(DIGITS).tolist()]
    row |= _numbers({name: x for name, x in derived.coefficients.items() if name not in row}) | {
        "law": damping.selected,
        "admissible": " ".join(damping.admissible),
        "stated_law": damping.stated or None,
        "one_law": derived.law or None,
        "undetermined": " ".join(undetermined) or None,
        "reduced_chi2": _number(damping.best.reduced_chi2),
        "correlations": _json({"names": list(derived.joint.names), "matrix": matrix}),
        "drag_points": _json(_drag_points(analysis, motion)),
    }
    try:
        spring = SpringRun.of("", derived, clock=analysis.track.clock)
    except AnalysisError:
        return  # without a mass, no spring constant can be compared
    row["u_clock"] = _number(spring.u_clock)
    row |= _numbers({"natural_angular_frequency": spring.angular_frequency, "own_mass_kg": spring.mass_kg})


def _numbers(estimates: Mapping[str, Estimate]) -> dict[str, float | None]:
    shown = {name: x for name, x in estimates.items() if name in ESTIMATES}
    return {f"{name}{end}": _number(y) for name, x in shown.items() for end, y in (("", x.value), ("_u", x.u))}


def _number(x: Any) -> float | None:
    return float(x) if math.isfinite(x) and abs(x) <= LARGEST else None


def _json(value: Any) -> str | None:
    """Return canonical JSON in one line; None for what is empty."""
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"), sort_keys=True) if value else None


def _drag_points(analysis: Analysis, motion: Oscillation) -> list[list[float]]:
    """Return Re, KC, drag coefficient and its u at amplitudes spaced evenly on a logarithmic scale."""
    diameter, derived, estimates = analysis.scene.disc_diameter_m, motion.derived, analysis.estimates
    curve = derived.drag_curve(motion.damping, motion.demodulated)
    if curve is None or diameter is None or derived.displacement is None or "reynolds_number" not in estimates:
        return []
    lengths: F8 = curve.x * derived.displacement.value
    order = np.argsort(lengths)
    if not lengths[order[0]] > 0:
        return []
    at = np.geomspace(lengths[order[0]], lengths[order[-1]], DRAG_POINTS)
    value, u = (np.interp(at, lengths[order], each[order]) for each in (curve.y, curve.u))
    # The Re estimate uses the rms velocity of the whole run; at amplitude A the rms velocity is omega A / sqrt 2.
    per_velocity = estimates["reynolds_number"].value / estimates["velocity_rms"].value
    reynolds = per_velocity * estimates["angular_frequency"].value * at / np.sqrt(2.0)
    points = np.column_stack([reynolds, 2.0 * np.pi * at / diameter.value, value, u])
    kept = np.isfinite(points).all(axis=1) & (np.abs(points).max(axis=1) <= LARGEST)
    return [[float(f"{x:.6g}") for x in point] for point in points[kept].tolist()]


def _period_s(analysis: Analysis) -> float:
    """Return the period, or, if there is none, a time too short to limit the number of bins."""
    return analysis.estimates["period"].value if "period" in analysis.estimates else 1e-9


def _thumbnail(t: F8, y: F8, period_s: float) -> str:
    """Return an outline of the recording as an SVG path in a box of 120 by 30; empty if nothing was measured."""
    there = np.isfinite(t) & np.isfinite(y)
    order = np.argsort(t[there], kind="stable")
    t, y = t[there][order], y[there][order]
    if t.size < 2 or not np.ptp(t) > 0:
        return ""
    span = t[-1] - t[0]
    count = int(np.clip(span / period_s, FEWEST_BINS, BINS))  # a bin shorter than a period would not show the outline
    ends = np.searchsorted(t, t[0] + span * np.arange(count + 1) / count)
    filled = np.flatnonzero(np.diff(ends))
    low, high = (edge.reduceat(y, ends[filled]) for edge in (np.minimum, np.maximum))
    beyond = y.size // 200  # the extreme 0.5 % are ignored, so that false echoes do not flatten the outline
    bottom, top = np.partition(y, (beyond, -1 - beyond))[[beyond, -1 - beyond]]
    scale = 28.0 / max(top - bottom, 1e-300)
    above, below = (np.clip(29.0 - (edge - bottom) * scale, 0.0, 30.0).round() for edge in (high, low))
    x = ((filled + 0.5) * 120.0 / count).round(1).tolist()
    edge = [*zip(x, above.tolist(), strict=True), *reversed([*zip(x, below.tolist(), strict=True)])]
    return "M" + "L".join(f"{a:g} {b:g}" for a, b in edge) + "Z"
