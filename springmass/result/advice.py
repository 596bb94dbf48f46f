"""Advice to a reader: what a finding does to the results, and what a lab report should say about it."""

from __future__ import annotations

import enum
from collections.abc import Container, Iterable, Mapping
from typing import Any

from pipeline.findings.finding import kinds
from springmass.typeset import typeset

SEVERITY_WORDS = {"error": "Error", "warning": "Warning", "info": "Note"}


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
            "word": SEVERITY_WORDS[finding["severity"]],
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
