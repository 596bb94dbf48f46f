"""Turn a run into its row: the work of every process, on this machine or another."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.errors import AcquisitionError, NeedsAnswer
from pipeline.analyse import Analysis, Oscillation, Overdamped
from pipeline.bench.scene import PLACES
from pipeline.errors import AnalysisError, PipelineError
from pipeline.numerics.estimate import Estimate, UpperLimit
from pipeline.numerics.threads import one_thread
from pipeline.results.compare import SpringRun
from pipeline.track import F8
from springmass.batch.plan import Job, code_sha256
from springmass.batch.rows import ESTIMATES, LARGEST
from springmass.batch.store import sha256_of
from springmass.errors import NO_MEMORY, ProgramError, internal_error, quietly
from springmass.report.advice import Harm, harm_of, sentence
from springmass.runs.about import about_path
from springmass.runs.loading import Loaded
from springmass.runs.options import How
from springmass.runs.questions import for_course
from springmass.runs.run import Run
from storage.errors import StorageError

__all__ = ["analyse_job", "analyse_many", "blank_row", "stamps_of", "unchanged"]

BINS, FEWEST_BINS = 60, 8  # maximum and minimum number of bins in a thumbnail
DRAG_POINTS = 8
DIGITS = 6  # decimal places of a correlation


def analyse_many(jobs: Sequence[Job]) -> list[dict[str, Any]]:
    """Analyse runs one after the other; a run that fails gets a row as well."""
    # Messages about a recording go into its row. Threads are limited once instead of in every analysis.
    with quietly(), one_thread:
        return [analyse_one(job) for job in jobs]


def analyse_one(job: Job) -> dict[str, Any]:
    """Return a run's row: JSON-serialisable, and identical on every machine and at every time."""
    row = blank_row(job)
    try:
        row["stamps"] = stamps_of(job)  # first, so that the next pass detects a change during analysis
        row["hashes"] = {path: sha256_of(job.whole(path)) for path, *_ in row["stamps"]}
        row["input_sha256"] = row["hashes"].get(job.path)
        run = analyse_job(job)
        _fill(row, run.loaded, run.analysis)
    except NeedsAnswer as error:
        row["error"] = _one_line(job, str(error.with_remedy(for_course(error.question))))
    except (ProgramError, AcquisitionError, PipelineError, StorageError, OSError) as error:
        row["error"] = _one_line(job, str(error))
    except MemoryError:
        row["error"] = f"{job.path}: {NO_MEMORY}"
    except Exception as error:  # a defect in the program must not stop the analysis of the other runs
        row["error"] = _one_line(job, f"{job.path}: {internal_error(error)}")
    return row


def analyse_job(job: Job) -> Run:
    """Read a run of a course and analyse it with the scene and options of its job."""
    how = How.of({**job.answers, "accuracy": job.accuracy, "law": job.law})
    if how.velocity is not None:
        how = replace(how, velocity=job.whole(str(how.velocity)))
    return Run.of(job.whole(job.path), job.scene, how)


def blank_row(job: Job, status: str = "failed", error: str = "") -> dict[str, Any]:
    """Return the row of a run for which only the job is known."""
    return {
        "path": job.path,
        "status": status,
        "error": error,
        "estimates": {},
        "scene": {},
        "quality": {},
        "findings": [],
        "messages": [],
        "tell": [],
        "correlations": {},
        "drag_points": [],
        "thumbnail": "",
        "stamps": [],
        "hashes": {},
        "input_sha256": None,
        "scene_sha256": job.scene_sha256,
        "parameters_sha256": job.parameters_sha256,
        "code_sha256": code_sha256(),
        "job": job.to_mapping(),
    }


def stamps_of(job: Job) -> list[list[Any]]:
    """Return path, size and modification time in ns of every existing file from which a run is read."""
    stamps = []
    for path in (job.path, job.answers.get("velocity"), str(about_path(Path(job.path)))):
        if path:
            try:
                status = os.stat(job.whole(path))
            except (OSError, ValueError):
                continue
            stamps.append([path, status.st_size, status.st_mtime_ns])
    return stamps


def unchanged(job: Job, row: Mapping[str, Any], *, rehash: bool) -> list[list[Any]] | None:
    """Return the stamps of a run's files if a row is up to date; None if the run has to be analysed again.

    Files with the same path, size and modification time count as unchanged, unless ``rehash`` requires all files to be
    read. All other files are unchanged if their digests are equal.
    """
    digests = (row["scene_sha256"], row["parameters_sha256"], row["code_sha256"])
    if row["status"] == "ended" or digests != (job.scene_sha256, job.parameters_sha256, code_sha256()):
        return None
    stamps = stamps_of(job)
    if stamps == row["stamps"] and not rehash:
        return stamps
    if [path for path, *_ in stamps] != [path for path, *_ in row["stamps"]]:
        return None
    try:
        same = all(sha256_of(job.whole(path)) == row["hashes"].get(path) for path, *_ in stamps)
    except OSError:
        return None
    return stamps if same else None


def _fill(row: dict[str, Any], loaded: Loaded, analysis: Analysis) -> None:
    track, motion, findings = analysis.track, analysis.motion, analysis.findings
    moves = isinstance(motion, (Oscillation, Overdamped))
    by_harm = sorted(((harm_of(f.code, f.severity), f) for f in findings), key=lambda pair: pair[0])
    row.update(
        status="ok" if moves else "no_oscillation",
        error="" if moves else f"{row['path']}: no oscillation: {motion.why}",
        format=loaded.format,
        kind=loaded.info.kind,
        channel=loaded.channel or None,
        unit=track.unit,
        start_time=loaded.provenance.get("start_time"),
        clock=track.clock,
        samples=len(track),
        rate_hz=_number(track.rate_hz),
        duration_s=_number(track.t[-1] - track.t[0]) if len(track) else 0.0,
        estimates=_numbers(analysis.estimates),
        scene={name: [x.value, x.u] for name in PLACES if (x := getattr(analysis.scene, name)) is not None},
        quality={**analysis.quality, "malformed_rows": loaded.malformed_rows},
        errors=sum(f.severity == "error" for f in findings),
        warnings=sum(f.severity == "warning" for f in findings),
        findings=[f.code for f in findings],
        messages=[[f.severity, f.message] for f in findings if f.severity != "info"],
        tell=[f"{sentence(f.message)} {f.advice}".rstrip() for harm, f in by_harm if harm <= Harm.PART],
        thumbnail=_thumbnail(track.t, track.y, _period_s(analysis)),
    )
    if isinstance(motion, Oscillation):
        damping, derived = motion.damping, motion.derived
        row["law"], row["admissible"] = damping.selected, " ".join(damping.admissible)
        row["stated_law"], row["one_law"] = damping.stated or None, derived.law or None
        undetermined = [name for name, x in derived.coefficients.items() if isinstance(x, UpperLimit)]
        row["undetermined"] = " ".join(undetermined) or None
        row["reduced_chi2"] = _number(damping.best.reduced_chi2)
        row["estimates"] |= _numbers({k: x for k, x in derived.coefficients.items() if k not in row["estimates"]})
        row["correlations"] = {
            "names": list(derived.joint.names),
            "matrix": [[_number(x) for x in line] for line in derived.joint.correlation.round(DIGITS).tolist()],
        }
        row["drag_points"] = _drag_points(analysis, motion)
        try:
            spring = SpringRun.of("", derived, clock=track.clock)
        except AnalysisError:
            return  # without a mass, no spring constant can be compared
        row["u_clock"] = _number(spring.u_clock)
        row["estimates"] |= _numbers(
            {"natural_angular_frequency": spring.angular_frequency, "own_mass_kg": spring.mass_kg}
        )


def _numbers(estimates: Mapping[str, Estimate]) -> dict[str, list[float | None]]:
    return {name: [_number(x.value), _number(x.u)] for name, x in estimates.items() if name in ESTIMATES}


def _number(x: Any) -> float | None:
    return float(x) if math.isfinite(x) and abs(x) <= LARGEST else None


def _drag_points(analysis: Analysis, motion: Oscillation) -> list[list[float]]:
    """Return Re, KC, drag coefficient and its u at amplitudes spaced evenly on a logarithmic scale."""
    diameter, derived = analysis.scene.disc_diameter_m, motion.derived
    curve = derived.drag_curve(motion.damping, motion.demodulated)
    estimates = analysis.estimates
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
    return [
        [float(f"{x:.6g}") for x in point]
        for point in points.tolist()
        if np.isfinite(point).all() and np.abs(point).max() <= LARGEST
    ]


def _period_s(analysis: Analysis) -> float:
    """Return the period, or, if there is none, a time too short to limit the number of bins."""
    return analysis.estimates["period"].value if "period" in analysis.estimates else 1e-9


def _thumbnail(t: F8, y: F8, period_s: float) -> str:
    """Return an outline of the recording as an SVG path in a box of 120 by 30; empty if nothing was measured."""
    there = np.isfinite(t) & np.isfinite(y)
    if not there.all():
        t, y = t[there], y[there]
    if t.size < 2 or not np.ptp(t) > 0:
        return ""
    if np.any(np.diff(t) < 0):
        order = np.argsort(t, kind="stable")
        t, y = t[order], y[order]
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


def _one_line(job: Job, message: str) -> str:
    """Return a message in one line that names the run by its path as given in the inputs."""
    line = " ".join(message.replace(job.whole(job.path), job.path).split())
    return line if job.path in line else f"{job.path}: {line}"
