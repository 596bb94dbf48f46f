"""Turn a run into its row, or into its report: the work of every process, on this machine or another."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from acquisition.errors import AcquisitionError, NeedsAnswer, visible
from pipeline.analyse import Analysis, Oscillation, Overdamped
from pipeline.bench.scene import PLACES
from pipeline.errors import AnalysisError, PipelineError
from pipeline.numerics.estimate import Estimate, UpperLimit
from pipeline.numerics.threads import one_thread
from pipeline.results.compare import SpringRun
from springmass.charts.drag_map import drag_points
from springmass.charts.outline import outline
from springmass.course.plan import Job, code_sha256, digest_of
from springmass.course.rows import ESTIMATES
from springmass.errors import NO_MEMORY, ProgramError, internal_error, quietly
from springmass.report.advice import Harm, harm_of, sentence
from springmass.report.script import SHARED
from springmass.runs.options import How
from springmass.runs.questions import for_course
from springmass.runs.run import Run
from storage.errors import StorageError

LARGEST = 1e100
"""Maximum magnitude of numbers in a row, whose square is still finite. Larger estimates are left out."""
DIGITS = 6  # decimal places of a correlation
TIME = "by springmass batch"  # in place of a time, so that a pass at any time gives the same bytes


def analyse_job(job: Job) -> Run:
    """Read a run of a course and analyse it with the scene and options of its job."""
    how = How.of({**job.answers, "accuracy": job.accuracy, "law": job.law})
    if how.velocity is not None:
        how = replace(how, velocity=job.whole(str(how.velocity)))
    return Run.of(job.whole(job.path), job.scene, how)


def write_reports(tasks: Sequence[tuple[str, Job, Path]]) -> list[str]:
    """Write the reports of runs, given by name, job and folder; return a reason for each that cannot be written."""
    return [_attempt(task[1], partial(_write_report, *task)) for task in tasks]


def _write_report(name: str, job: Job, folder: Path) -> None:
    from springmass.report.write import write_report

    with quietly():
        run = analyse_job(job)
        run = replace(run, loaded=replace(run.loaded, path=Path(job.path)), name=name, time_utc=TIME)
        write_report(folder, [run], script=f"../../{SHARED}")


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
    failure = _attempt(job, lambda: fill(row, analyse_job(job)))
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


def fill(row: dict[str, Any], run: Run) -> None:
    """Fill the row of a run with its results."""
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
        "thumbnail": outline(analysis),
    }  # fmt: skip
    if isinstance(motion, Oscillation):
        _fill_damping(row, analysis, motion)
    row["status"] = "ok" if moves else "no_oscillation"
    row["error"] = "" if moves else f"{row['path']}: no oscillation: {run.why}"


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
        "drag_points": _json(drag_points(analysis)),
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
