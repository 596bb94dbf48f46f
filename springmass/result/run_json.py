"""The JSON of a run: one schema for the command line, the report's results.json and scripts.

Its types are those of what :func:`plain` is given, and a reader's JSON Schema is made from them: an estimate, a finding
or an effect has its fields. What they mean is in docs/reference/json.md, which has a row for each.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any, Final, Literal, TypedDict, TypeVar, cast

from acquisition.recordings.recording import FormatIssue
from pipeline.analysis import Analysis
from pipeline.damping.law_fit import Rejection
from pipeline.findings.finding import UNKNOWN_CODE, Finding, by_severity, kinds, word
from pipeline.notice import Notice
from pipeline.numerics.estimate import Estimate, UpperLimit
from pipeline.results.budget import Budget, Contribution, Evaluation
from pipeline.results.effects import Effect
from springmass import __version__
from springmass.loading.loaded import Loaded
from springmass.result.grades import Grade, grades_of

RESULT_SCHEMA: Final = 3
EXPANDED = ("dof", "coverage_factor", "expanded")  # of a budget, for its expanded uncertainty


class RecordingInput(TypedDict):
    """What was read."""

    path: str
    format: str
    sha256: str
    kind: str
    channel: str
    samples: int
    rate_hz: float
    duration_s: float


class RecordedMark(TypedDict):
    """A mark of a recording."""

    t_s: float
    text: str


class RecordedEvent(TypedDict):
    """What happened while recording."""

    t_s: float
    kind: str
    facts: Mapping[str, Any]


class Recorded(TypedDict):
    """What was noted during the recording, and afterwards."""

    start_time: str | None
    calibration: Mapping[str, Any]
    events: Sequence[RecordedEvent]
    marks: Sequence[RecordedMark]
    notes: Sequence[str]


class NumberWithU(TypedDict):
    """A number with its standard uncertainty."""

    value: float
    u: float
    unit: str


class BudgetInput(TypedDict):
    """A contribution to an uncertainty."""

    name: str
    type: Evaluation
    value: float | None
    u: float | None
    unit: str
    sensitivity: float | None
    contribution: float
    share: float
    dof: float


class ResultBudget(NumberWithU):
    """The uncertainty of one result."""

    dof: float
    coverage_factor: float
    expanded: float
    inputs: Sequence[BudgetInput]


class Correlations(TypedDict):
    """The correlations between the results."""

    names: Sequence[str]
    matrix: Sequence[Sequence[float]]


class Parameter(NumberWithU):
    """A parameter of a law."""

    determined: bool
    upper_limit: float | None


class Coefficient(Parameter):
    """A coefficient among the results, and the law that it belongs to."""

    law: str


class FittedLaw(TypedDict):
    """The fit of one law."""

    parameters: Mapping[str, Parameter]
    reduced_chi2: float
    dof: float
    bic: float
    rejected: bool
    rejection: Rejection


class DampingLaws(TypedDict):
    """The fits of the damping laws."""

    selected: str | None
    admissible: Sequence[str]
    stated: str | None
    law: str | None
    weights: Mapping[str, float]
    of_law: Sequence[str]
    coefficients: Mapping[str, Coefficient]
    laws: Mapping[str, FittedLaw]


class GradeJson(TypedDict):
    """Whether a number may be quoted."""

    grade: Grade
    reasons: Sequence[str]


class Details(TypedDict):
    """What is empty for a motion that does not oscillate."""

    budget: Mapping[str, ResultBudget]
    correlations: Correlations
    damping: DampingLaws
    grades: Mapping[str, GradeJson]


class Provenance(TypedDict):
    """How to reproduce a result."""

    version: str
    accuracy: str
    parameters: Mapping[str, Any]
    time_utc: str


class RunResult(Details):
    """The result of one run."""

    schema: Literal[3]
    input: RecordingInput
    recorded: Recorded
    quality: Mapping[str, int]
    estimates: Mapping[str, Estimate]
    effects: Sequence[Effect]
    findings: Sequence[Finding]
    provenance: Provenance


Fields = TypeVar("Fields")
NO_DETAILS: Details = {
    "budget": {},
    "correlations": {"names": [], "matrix": []},
    "damping": {
        "selected": None,
        "admissible": [],
        "stated": None,
        "law": None,
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


def details_of(analysis: Analysis) -> Details:
    """Return budgets, correlations, damping and grades, which are empty for a motion that does not oscillate."""
    if not analysis.damping.fits:
        return NO_DETAILS
    joint = analysis.derived.joint
    return {
        "grades": {
            name: {"grade": graded.grade, "reasons": [reason.code for reason in graded.reasons]}
            for name, graded in grades_of(analysis).items()
        },
        "damping": _damping(analysis),
        "budget": {name: _budget(budget) for name, budget in analysis.budgets.items()},
        "correlations": {"names": joint.names, "matrix": joint.correlation.round(6).tolist()},
    }


def provenance_of(accuracy: str, parameters: Mapping[str, Any], time_utc: str) -> Provenance:
    """Return the ``provenance`` object: how to reproduce this result."""
    return {"version": __version__, "accuracy": accuracy, "parameters": dict(parameters), "time_utc": time_utc}


def input_of(loaded: Loaded) -> RecordingInput:
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


def recorded_of(loaded: Loaded) -> Recorded:
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


def _budget(budget: Budget) -> ResultBudget:
    x, inputs = budget.estimate, [_contribution(c) for c in budget.contributions]
    return fields_of(ResultBudget, budget, value=x.value, u=x.u, unit=x.unit, inputs=inputs)


def _contribution(c: Contribution) -> BudgetInput:
    x = c.input
    given = {"value": None, "u": None, "unit": ""} if x is None else {"value": x.value, "u": x.u, "unit": x.unit}
    return fields_of(BudgetInput, c, type=c.kind, contribution=c.u, **given)


def _damping(analysis: Analysis) -> DampingLaws:
    damping, derived = analysis.damping, analysis.derived
    coefficients = parameters_json(derived.coefficients)
    return fields_of(
        DampingLaws,
        damping,
        stated=damping.stated or None,
        law=derived.law or None,
        weights={of_law.fit.name: of_law.weight for of_law in derived.laws},
        of_law=sorted(derived.of_law),
        coefficients={name: {**x, "law": derived.law_of_coefficients} for name, x in coefficients.items()},
        laws={
            name: fields_of(FittedLaw, fit, parameters=parameters_json(derived.parameters_of(fit)))
            for name, fit in damping.fits.items()
        },
    )


def parameters_json(estimates: Mapping[str, Estimate]) -> dict[str, Parameter]:
    """Return parameters of a law, with a flag for whether each is determined and, if not, its upper limit."""
    limits = {name: x.limit if isinstance(x, UpperLimit) else None for name, x in estimates.items()}
    return {
        name: fields_of(Parameter, x, determined=limits[name] is None, upper_limit=limits[name])
        for name, x in estimates.items()
    }


def fields_of(kind: type[Fields], thing: object, **others: Any) -> Fields:
    """Return the fields of a type of JSON: those that are given, and the others as attributes of an object."""
    names = kind.__annotations__
    return cast(Fields, {name: others[name] if name in others else getattr(thing, name) for name in names})


def picked(thing: object, names: Sequence[str]) -> dict[str, Any]:
    """Return a mapping of the named attributes of an object."""
    return {name: getattr(thing, name) for name in names}


def plain(value: object) -> Any:
    """Return a value in a form that strict JSON can represent.

    An estimate or a dataclass becomes a mapping of its fields, and a number that is not finite becomes null.
    """
    if isinstance(value, Estimate):
        return plain(fields_of(NumberWithU, value))
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
