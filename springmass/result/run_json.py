"""The JSON of a run: one schema for the command line, the report's results.json and scripts.

Estimates, findings, effects and traps appear in it with their fields, as :func:`plain` returns them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

from acquisition.recordings.recording import FormatIssue
from pipeline.analysis import Analysis
from pipeline.findings.finding import UNKNOWN_CODE, Finding, by_severity, kinds, word
from pipeline.notice import Notice
from pipeline.numerics.estimate import Estimate, UpperLimit
from pipeline.results.budget import Contribution
from springmass import __version__
from springmass.loading.loaded import Loaded
from springmass.result.grades import grades_json

RESULT_SCHEMA = 3
EXPANDED = ("dof", "coverage_factor", "expanded")  # of a budget, for its expanded uncertainty
NO_DETAILS: Mapping[str, Any] = {
    "budget": {},
    "correlations": {"names": [], "matrix": []},
    "damping": {
        **dict.fromkeys(("selected", "stated", "law")),
        "admissible": [],
        "weights": {},
        "of_law": [],
        "coefficients": {},
        "laws": {},
    },
    "grades": {},
}


def rejected(findings: Sequence[Mapping[str, str]]) -> list[str]:
    """Return the codes that ``--strict`` rejects: errors, and warnings that the run is not the intended one."""
    grave = [f["code"] for f in findings if f["severity"] == "error" or "strict" in kinds()[f["code"]].about]
    return list(dict.fromkeys(grave))


def details_of(analysis: Analysis) -> Mapping[str, Any]:
    """Return budgets, correlations, damping and grades, which are empty for a motion that does not oscillate."""
    if not analysis.damping.fits:
        return NO_DETAILS
    joint = analysis.derived.joint
    return {
        "budget": _budgets(analysis),
        "correlations": {"names": joint.names, "matrix": joint.correlation.round(6)},
        "damping": _damping(analysis),
        "grades": grades_json(analysis),
    }


def provenance_of(accuracy: str, parameters: Mapping[str, Any], time_utc: str) -> dict[str, Any]:
    """Return the ``provenance`` object: how to reproduce this result."""
    return {"version": __version__, "accuracy": accuracy, "parameters": dict(parameters), "time_utc": time_utc}


def input_of(loaded: Loaded) -> dict[str, Any]:
    """Return the ``input`` object: what was analysed."""
    track = loaded.track
    return {
        "path": loaded.source,
        "format": loaded.format,
        "sha256": loaded.sha256,
        "kind": loaded.info.kind,
        "channel": loaded.channel,
        "samples": len(track),
        "rate_hz": track.rate_hz,
        "duration_s": track.t[-1] - track.t[0] if len(track) else 0.0,
    }


def recorded_of(loaded: Loaded) -> dict[str, Any]:
    """Return the notes made during a recording and later: marks, remarks, trigger and other events, calibration."""
    provenance = loaded.provenance
    return {
        "start_time": provenance.get("start_time"),
        "calibration": (provenance.get("sensor") or {}).get("calibration") or {},
        "events": list(provenance.get("events", ())),
        "marks": list(provenance.get("marks", ())),
        "notes": list(provenance.get("notes", ())),
    }


def with_traps(findings: Sequence[Finding], traps: Sequence[FormatIssue]) -> tuple[Finding, ...]:
    """Return the findings of an analysis and of the reader, the most severe first."""
    codes = {finding.code for finding in findings}
    return by_severity([*findings, *(_of_reader(trap) for trap in traps if trap.code not in codes)])


def _of_reader(trap: FormatIssue) -> Finding:
    if trap.code in kinds():
        return word(Notice(trap.code, {"sentence": _sentence(trap.message)}))
    # A run file may come from a version that knows more codes than this one.
    return word(Notice(UNKNOWN_CODE, {"sentence": f"{trap.code}: {trap.message}"}))


def _sentence(clause: str) -> str:
    """Return a clause worded by a file reader as a full sentence, like the messages of all other findings."""
    end = "" if clause.endswith((".", '"')) else "."
    first = clause.split(" ", 1)[0]
    # A name, such as a file name, keeps its case.
    return (clause[0].upper() + clause[1:] if first.isalpha() else clause) + end


def _budgets(analysis: Analysis) -> dict[str, Any]:
    return {
        name: {
            **plain(budget.estimate),
            **plain(picked(budget, EXPANDED)),
            "inputs": [_contribution(c) for c in budget.contributions],
        }
        for name, budget in analysis.budgets.items()
    }


def _contribution(c: Contribution) -> dict[str, Any]:
    given = {"value": None, "u": None, "unit": ""} if c.input is None else plain(c.input)
    numbers = {"sensitivity": c.sensitivity, "contribution": c.u, "share": c.share, "dof": plain(c.dof)}
    return {"name": c.name, "type": c.kind, **given, **numbers}


def _damping(analysis: Analysis) -> dict[str, Any]:
    damping, derived = analysis.damping, analysis.derived
    keys, coefficients = ("reduced_chi2", "dof", "bic", "rejected", "rejection"), parameters_json(derived.coefficients)
    laws = {
        name: {"parameters": parameters_json(derived.parameters_of(fit)), **picked(fit, keys)}
        for name, fit in damping.fits.items()
    }
    return {
        **picked(damping, ("selected", "admissible")),
        "stated": damping.stated or None,
        "law": derived.law or None,
        "weights": {of_law.fit.name: of_law.weight for of_law in derived.laws},
        "of_law": sorted(derived.of_law),
        "coefficients": {name: {**x, "law": derived.law_of_coefficients} for name, x in coefficients.items()},
        "laws": laws,
    }


def parameters_json(estimates: Mapping[str, Estimate]) -> dict[str, dict[str, Any]]:
    """Return parameters of a law, with a flag for whether each is determined and, if not, its upper limit."""
    return {
        name: {
            **plain(x),
            "determined": not isinstance(x, UpperLimit),
            "upper_limit": x.limit if isinstance(x, UpperLimit) else None,
        }
        for name, x in estimates.items()
    }


def picked(thing: object, names: Sequence[str]) -> dict[str, Any]:
    """Return a mapping of the named attributes of an object."""
    return {name: getattr(thing, name) for name in names}


def plain(value: object) -> Any:
    """Return a value in a form that strict JSON can represent.

    An estimate or a dataclass becomes a mapping of its fields, and a number that is not finite becomes null.
    """
    if isinstance(value, Estimate):
        return {name: plain(getattr(value, name)) for name in ("value", "u", "unit")}
    if isinstance(value, Mapping):
        return {str(key): plain(inner) for key, inner in value.items()}
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if hasattr(value, "tolist"):  # NumPy scalars and arrays
        return plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(inner) for inner in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int | str) else str(value)
