"""One run to one row: what every process does, here or on another machine."""

from __future__ import annotations

import hashlib
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.errors import AcquisitionError, NeedsAnswer
from acquisition.regular_file import open_regular
from pipeline.accuracy import params_for
from pipeline.analyse import Analysis, Oscillation, Overdamped, analyse
from pipeline.bench.scene import PLACES, Scene
from pipeline.errors import AnalysisError, PipelineError
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.threads import one_thread
from pipeline.results.compare import SpringRun
from pipeline.track import F8
from springmass.batch.plan import Job, code_sha256
from springmass.batch.rows import ESTIMATES
from springmass.errors import ProgramError, hushed, internal_error
from springmass.runs.about import about_path
from springmass.runs.analysing import scene_of
from springmass.runs.json_results import all_findings
from springmass.runs.loading import Loaded, load
from springmass.runs.questions import for_course
from storage.errors import StorageError

__all__ = ["analyse_many", "blank_row", "load_job", "stamps_of", "unchanged"]

BINS, FEWEST_BINS = 60, 8  # of a thumbnail
DRAG_POINTS = 8
DIGITS = 6  # of a correlation


def analyse_many(jobs: Sequence[Job]) -> list[dict[str, Any]]:
    """Analyse runs one after the other; one that fails is a row as well."""
    # What a recording has to say stands in its row. Threads are set once, not by each analysis.
    with hushed(), one_thread:
        return [analyse_one(job) for job in jobs]


def analyse_one(job: Job) -> dict[str, Any]:
    """Return a run's row: JSON-able, and the same wherever and whenever it is made."""
    row = blank_row(job)
    try:
        row["stamps"] = stamps_of(job)  # first: a file that changes meanwhile is another by the next pass
        row["hashes"] = {path: _sha256(job.whole(path)) for path, *_ in row["stamps"]}
        row["input_sha256"] = row["hashes"].get(job.path)
        loaded, given = load_job(job)
        analysis = analyse(loaded.track, scene_of(loaded, given), params_for(job.accuracy))
        _fill(row, loaded, analysis)
    except NeedsAnswer as asked:
        row["error"] = _told(job, str(asked.with_remedy(for_course(asked.question))))
    except (ProgramError, AcquisitionError, PipelineError, StorageError, OSError) as error:
        row["error"] = _told(job, str(error))
    except MemoryError:
        row["error"] = f"{job.path}: more memory was demanded than there is; analyse it with fewer processes"
    except Exception as error:  # a defect: the other runs of a thousand are not to wait for its repair
        row["error"] = _told(job, f"{job.path}: {internal_error(error)}")
    return row


def load_job(job: Job) -> tuple[Loaded, Scene | None]:
    """Return a run's recording, and the scene that was given for it."""
    answers = dict(job.answers)
    if "velocity" in answers:
        answers["velocity"] = job.whole(answers["velocity"])
    loaded = load(job.whole(job.path), **answers)
    return loaded, None if job.scene is None else Scene.from_mapping(job.scene)


def blank_row(job: Job, status: str = "failed", error: str = "") -> dict[str, Any]:
    """Return the row of a run of which nothing is known but what was asked for."""
    return {
        "path": job.path,
        "status": status,
        "error": error,
        "estimates": {},
        "scene": {},
        "quality": {},
        "findings": [],
        "messages": [],
        "correlations": {},
        "drag_points": [],
        "thumbnail": "",
        "stamps": [],
        "hashes": {},
        "input_sha256": None,
        "scene_sha256": job.scene_sha256,
        "parameters_sha256": job.parameters_sha256,
        "code_sha256": code_sha256(),
        "job": job.told(),
    }


def stamps_of(job: Job) -> list[list[Any]]:
    """Return path, size and time of modification in ns of every file that a run is read from; absent ones are not."""
    beside = str(about_path(Path(job.path)))
    found = []
    for path in (job.path, job.answers.get("velocity"), beside):
        if path:
            try:
                told = os.stat(job.whole(path))
            except (OSError, ValueError):
                continue
            found.append([path, told.st_size, told.st_mtime_ns])
    return found


def unchanged(job: Job, row: Mapping[str, Any], *, rehash: bool) -> list[list[Any]] | None:
    """Return the stamps of a run's files where a row still holds for it; None where it has to be analysed again.

    Files of the same path, size and time of modification count as unchanged unless ``rehash`` asks for all to be read;
    others are unchanged where their digests are.
    """
    told = (row["scene_sha256"], row["parameters_sha256"], row["code_sha256"])
    if row["status"] == "ended" or told != (job.scene_sha256, job.parameters_sha256, code_sha256()):
        return None
    stamps = stamps_of(job)
    if stamps == row["stamps"] and not rehash:
        return stamps
    if [path for path, *_ in stamps] != [path for path, *_ in row["stamps"]]:
        return None
    try:
        same = all(_sha256(job.whole(path)) == row["hashes"].get(path) for path, *_ in stamps)
    except OSError:
        return None
    return stamps if same else None


def _fill(row: dict[str, Any], loaded: Loaded, analysis: Analysis) -> None:
    track, motion, findings = analysis.track, analysis.motion, all_findings(loaded, analysis)
    moves = isinstance(motion, (Oscillation, Overdamped))
    row.update(
        status="ok" if moves else "no_oscillation",
        error="" if moves else f"{row['path']}: no oscillation: {motion.why}",  # type: ignore[union-attr]
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
        thumbnail=_thumbnail(track.t, track.y, _period_s(analysis)),
    )
    if isinstance(motion, Oscillation):
        damping, derived = motion.damping, motion.derived
        row["law"], row["admissible"] = damping.selected, " ".join(damping.admissible)
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
            return  # no mass, no spring to compare
        row["u_clock"] = _number(spring.u_clock)
        row["estimates"] |= _numbers(
            {"natural_angular_frequency": spring.angular_frequency, "own_mass_kg": spring.mass_kg}
        )


def _numbers(estimates: Mapping[str, Estimate]) -> dict[str, list[float | None]]:
    return {name: [_number(x.value), _number(x.u)] for name, x in estimates.items() if name in ESTIMATES}


def _number(x: Any) -> float | None:
    return float(x) if math.isfinite(x) else None


def _drag_points(analysis: Analysis, motion: Oscillation) -> list[list[float]]:
    """Return Re, KC, drag coefficient and its u at amplitudes from the first to the last, evenly in their logarithm."""
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
    # Re is that of the whole run by its rms velocity; at one amplitude that velocity is omega A / sqrt 2.
    per_velocity = estimates["reynolds_number"].value / estimates["velocity_rms"].value
    reynolds = per_velocity * estimates["angular_frequency"].value * at / np.sqrt(2.0)
    points = np.column_stack([reynolds, 2.0 * np.pi * at / diameter.value, value, u])
    return [[float(f"{x:.6g}") for x in point] for point in points.tolist() if np.isfinite(point).all()]


def _period_s(analysis: Analysis) -> float:
    """Return the period, or so short a time that it limits nothing."""
    return analysis.estimates["period"].value if "period" in analysis.estimates else 1e-9


def _thumbnail(t: F8, y: F8, period_s: float) -> str:
    """Return an outline of the record, an SVG path in a box of 120 by 30; empty where nothing was measured."""
    there = np.isfinite(t) & np.isfinite(y)
    if not there.all():
        t, y = t[there], y[there]
    if t.size < 2 or not np.ptp(t) > 0:
        return ""
    if np.any(np.diff(t) < 0):
        order = np.argsort(t, kind="stable")
        t, y = t[order], y[order]
    span = t[-1] - t[0]
    count = int(np.clip(span / period_s, FEWEST_BINS, BINS))  # a bin without a whole period is no outline
    ends = np.searchsorted(t, t[0] + span * np.arange(count + 1) / count)
    filled = np.flatnonzero(np.diff(ends))
    low, high = (edge.reduceat(y, ends[filled]) for edge in (np.minimum, np.maximum))
    beyond = y.size // 200  # a false echo does not flatten the motion
    bottom, top = np.partition(y, (beyond, -1 - beyond))[[beyond, -1 - beyond]]
    scale = 28.0 / max(top - bottom, 1e-300)
    above, below = (np.clip(29.0 - (edge - bottom) * scale, 0.0, 30.0).round() for edge in (high, low))
    x = ((filled + 0.5) * 120.0 / count).round(1).tolist()
    edge = [*zip(x, above.tolist(), strict=True), *reversed([*zip(x, below.tolist(), strict=True)])]
    return "M" + "L".join(f"{a:g} {b:g}" for a, b in edge) + "Z"


def _told(job: Job, message: str) -> str:
    """Return a message in one line that names the run's path as the inputs do."""
    told = " ".join(message.replace(job.whole(job.path), job.path).split())
    return told if job.path in told else f"{job.path}: {told}"


def _sha256(path: str) -> str:
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
