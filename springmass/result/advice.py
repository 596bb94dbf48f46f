"""Advice to a reader: what a finding does to the results, and the grade of each number of Table 1: may it be quoted?"""

from __future__ import annotations

import enum
from collections.abc import Container, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

from pipeline.analyse import Analysis, Oscillation
from pipeline.findings.finding import kinds
from pipeline.numerics.estimate import Estimate, UpperLimit
from pipeline.registry.quantities import INPUTS, MADE_OF, QUANTITIES
from springmass.result.table1 import table_estimates, table_rows
from springmass.typeset import typeset

_WORDS = {"error": "Error", "warning": "Warning", "info": "Note"}


class Harm(enum.IntEnum):
    """What a finding does to the results, the worst first."""

    UNUSABLE = 0  # a result must not be used
    SCALE = 1  # if an assumption is wrong, every value is wrong by a factor
    PART = 2  # only part of the recording, or no damping law, could be used
    UNCERTAINTY = 3  # the values are valid, and their uncertainties were increased
    IMPROVABLE = 4  # the values are valid; a better recording or scene would reduce their uncertainties
    NOTE = 5  # no action is needed


_CONSEQUENCES = {
    Harm.UNUSABLE: "Values that depend on this are not reported.",
    Harm.SCALE: "All values depend on this; I checked it by ...",
    Harm.PART: "The values describe the analysed part only.",
    Harm.UNCERTAINTY: "The stated uncertainties include this.",
    Harm.IMPROVABLE: "",
}


def harm_of(code: str, severity: str) -> Harm:
    """Return the effect of a finding on the results."""
    if severity != "warning":
        return Harm.UNUSABLE if severity == "error" else Harm.NOTE
    return Harm[kinds()[code].harm.upper()]


def by_harm(findings: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Sort findings, given as in the result's JSON, with the most harmful first."""
    return sorted(findings, key=lambda finding: harm_of(finding["code"], finding["severity"]))


def is_standing(finding: Mapping[str, Any]) -> bool:
    """Return whether a note applies to every file of a format; it would hide what is special about this recording."""
    return finding["severity"] == "info" and "format" in kinds()[finding["code"]].about


def lab_report_line(finding: Mapping[str, Any]) -> str:
    """Return what a lab report should say about a warning; empty for a note.

    >>> lab_report_line({"code": "rest_drift", "severity": "warning", "message": "The rest position drifts by 1 mm."})
    'The rest position drifts by 1 mm. The stated uncertainties include this.'
    """
    harm, consequence = harm_of(finding["code"], finding["severity"]), kinds()[finding["code"]].consequence
    if harm is Harm.NOTE:
        return ""
    return f"{sentence(finding['message'])} {_CONSEQUENCES[harm] if consequence is None else consequence}".rstrip()


def notices_of(findings: Iterable[Mapping[str, Any]], figures: Container[str]) -> dict[str, list[dict[str, str]]]:
    """Group the findings by their place on the page: warnings, notes, notes on every file of the format.

    Those of the damping that the summary and the table of laws already state are in the group "law".
    """
    groups: dict[str, list[dict[str, str]]] = {"warnings": [], "notes": [], "standing": [], "law": []}
    for finding in by_harm(findings):
        kind, is_note = kinds()[finding["code"]], finding["severity"] == "info"
        notice = {
            "code": finding["code"],
            "severity": finding["severity"],
            "word": _WORDS[finding["severity"]],
            "message": sentence(typeset(finding["message"])),
            "advice": "" if is_note else finding["advice"],
            "details": typeset(finding.get("details", "")),
            "report": typeset(lab_report_line(finding)),
            "figure": kind.figure if kind.figure in figures else "",
        }
        group = "law" if is_note and "law" in kind.about else "standing" if is_standing(finding) else "notes"
        if group != "law" or all(other["code"] != notice["code"] for other in groups["law"]):
            groups[group if is_note else "warnings"].append(notice)
    return groups


def sentence(text: str) -> str:
    """Start a text with a capital and end it with a full stop."""
    return f"{text[:1].upper()}{text[1:]}{'' if text[-1:] in '.!?' else '.'}"


Grade = Literal["sound", "uncertain", "do not quote"]
GRADES: tuple[Grade, ...] = get_args(Grade)
UNCERTAIN = 0.05  # u over the value from which fewer than two digits are certain
MEANINGLESS = 0.5  # u over the value from which zero is within two standard uncertainties


@dataclass(frozen=True, slots=True)
class Trust:
    """Whether a number may be quoted, and why not."""

    grade: Grade
    why: str = ""


def trust_of(analysis: Analysis) -> dict[str, Trust]:
    """Return the trust in every quantity of Table 1 by its name; empty if nothing oscillates.

    A number is uncertain if it depends on an assumption that a warning names, if fewer than two of its digits are
    certain, or if it is an average over amplitudes at which it differs by more than 5 %. It is not to be quoted if an
    error concerns it, if zero is within two standard uncertainties, or if the recording contradicts the law that was
    stated for it. The worst of these decides; every reason is kept.
    """
    motion = analysis.motion
    if not isinstance(motion, Oscillation):
        return {}
    by_name = {}
    for key, x in table_estimates(analysis).items():
        reasons = [*_assumed(motion, analysis, key.name), *_sized(motion, key.name, x)]
        if motion.damping.best.rejected:
            if QUANTITIES[key.name].by_law and motion.damping.by_statement:
                reasons.append(Trust("do not quote", "the recording contradicts the stated law"))
            elif key.row:
                reasons.append(Trust("uncertain", "no damping law fits"))
        grade = max(reasons, key=lambda each: GRADES.index(each.grade), default=Trust("sound")).grade
        by_name[key.name] = Trust(grade, ", ".join(dict.fromkeys(each.why for each in reasons)))
    return by_name


def _assumed(motion: Oscillation, analysis: Analysis, name: str) -> Iterator[Trust]:
    """Yield the errors, the unchecked assumptions and the averages on which a quantity depends."""
    parts = {part for part, names in MADE_OF.items() if name in names}
    if any(each.name == "angular_frequency" for each in motion.derived.budgets[name].contributions):
        parts.add("frequency")
    for finding in analysis.findings:
        harm, concerned = harm_of(finding.code, finding.severity), MADE_OF.keys() & {*kinds()[finding.code].about}
        averaged = abs(finding.values.get("relative_shift", 0.0)) > UNCERTAIN
        if (averaged or harm in (Harm.UNUSABLE, Harm.SCALE)) and (not concerned or concerned & parts):
            yield Trust("do not quote" if harm is Harm.UNUSABLE else "uncertain", finding.code)


def _sized(motion: Oscillation, name: str, x: Estimate) -> Iterator[Trust]:
    """Judge a number by its u; a rest position has an arbitrary zero, and noise is not a result."""
    if isinstance(x, UpperLimit):
        yield Trust("sound", "as an upper limit")
    elif name not in ("offset", "noise") and x.u > UNCERTAIN * abs(x.value):
        greatest = INPUTS[motion.derived.budgets[name].contributions[0].name].label
        if x.u > MEANINGLESS * abs(x.value):
            share = f"u is {100.0 * x.u / abs(x.value):.0f} % of it: " if x.value else ""
            yield Trust("do not quote", f"{share}{greatest}")
        else:
            yield Trust("uncertain", greatest)


def trust_text(analysis: Analysis, *, page: bool = False) -> str:
    """Return the symbols of Table 1 in groups: sound, uncertain and not to be quoted, each with its reason."""
    by_name = trust_of(analysis)
    groups: dict[Grade, dict[str, list[str]]] = {grade: {} for grade in GRADES}
    for row in table_rows([analysis]):
        if row.name in by_name:
            trust = by_name[row.name]
            groups[trust.grade].setdefault(trust.why, []).append(row.on_screen if page else row.symbol)
    parts = []
    for grade, by_reason in groups.items():
        words = [f"{', '.join(symbols)}{f' ({why})' if why else ''}" for why, symbols in by_reason.items()]
        if words:
            parts.append(f"{grade[0].upper()}{grade[1:]}: {'; '.join(words)}.")
    return " ".join(parts)
