"""Warnings for a reader: which matter most, what to do about each, and what to write in a lab report."""

from __future__ import annotations

import enum
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pipeline.findings.finding import kinds
from springmass.report.words import typeset

__all__ = ["LAW_CODES", "STANDING", "Harm", "Notice", "by_harm", "harm_of", "lab_report_line", "notices_of"]

LAW_CODES = frozenset({"law_rejected", "laws_not_separable", "no_law_fits"})
"""Codes of findings that the sentence on damping and the table of laws already state."""
STANDING = ("nominal_clock", "stated_error_is_not_noise", "jittered_time", "offset_unknown", "velocity_missing")
"""Notes that apply to every file of a format; they would hide what is special about this recording."""

_WORDS = {"error": "Error", "warning": "Warning", "info": "Note"}


class Harm(enum.IntEnum):
    """Effects that a finding can have on the results, the most harmful first."""

    UNUSABLE = 0
    """A result must not be used."""
    SCALE = 1
    """If an assumption is wrong, every value is wrong by a factor."""
    PART = 2
    """Only part of the recording, or no damping law, could be used."""
    UNCERTAINTY = 3
    """The values are valid, and their uncertainties were increased."""
    IMPROVABLE = 4
    """The values are valid; a better recording or scene would reduce their uncertainties."""
    NOTE = 5
    """No action is needed."""


_CONSEQUENCES = {
    Harm.UNUSABLE: "Values that depend on this are not reported.",
    Harm.SCALE: "All values depend on this; I checked it by ...",
    Harm.PART: "The values describe the analysed part only.",
    Harm.UNCERTAINTY: "The stated uncertainties include this.",
    Harm.IMPROVABLE: "",
}


_OWN_CONSEQUENCES = {
    "amplitude_dependent_frequency": "",  # the message states it
    "clipped": "The values come from the other samples of each period.",
}
"""By the code of a finding, the consequence for the values if its harm alone does not state it."""


def harm_of(code: str, severity: str) -> Harm:
    """Return the effect of a finding on the results.

    Parameters
    ----------
    code : str
    severity : {"info", "warning", "error"}
    """
    if severity != "warning":
        return Harm.UNUSABLE if severity == "error" else Harm.NOTE
    return Harm[kinds()[code].harm.upper()]


def by_harm(findings: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Sort findings, given as in the result's JSON, with the most harmful first."""
    return sorted(findings, key=lambda finding: harm_of(finding["code"], finding["severity"]))


def lab_report_line(finding: Mapping[str, Any]) -> str:
    """Return what a lab report should say about a warning; empty for a note.

    Examples
    --------
    >>> lab_report_line({"code": "rest_drift", "severity": "warning", "message": "The rest position drifts by 1 mm."})
    'The rest position drifts by 1 mm. The stated uncertainties include this.'
    """
    harm = harm_of(finding["code"], finding["severity"])
    if harm is Harm.NOTE:
        return ""
    consequence = _OWN_CONSEQUENCES.get(finding["code"], _CONSEQUENCES[harm])
    return f"{_sentence(finding['message'])} {consequence}".rstrip()


@dataclass(frozen=True, slots=True)
class Notice:
    """One finding as the page shows it.

    Parameters
    ----------
    code, severity, word, message : str
        Code, severity, its word, and the typeset message as a sentence.
    advice : str
        What to do; empty for a note.
    details : str
        Statistics, alternatives and method.
    report : str
        What to write in a lab report; empty for a note.
    figure : str
        Name of the figure that shows the finding; empty if none does.
    """

    code: str
    severity: str
    word: str
    message: str
    advice: str
    details: str
    report: str
    figure: str


def notices_of(findings: Iterable[Mapping[str, Any]], figures: Sequence[str]) -> dict[str, Any]:
    """Group the findings by the place where the page shows them.

    Parameters
    ----------
    findings : iterable of mapping
        Findings as in the result's JSON.
    figures : sequence of str
        Names of the figures on the page.

    Returns
    -------
    dict
        "warnings": findings that affect the results, the most harmful first; "notes": all others; "standing": notes
        that apply to every file of the format; "law": codes of findings that the sentence on damping states.
    """
    groups: dict[str, Any] = {"warnings": [], "notes": [], "standing": [], "law": []}
    for finding in by_harm(findings):
        code, severity = finding["code"], finding["severity"]
        if code in LAW_CODES and severity == "info":
            if code not in groups["law"]:
                groups["law"].append(code)
            continue
        figure = kinds()[code].figure
        notice = Notice(
            code,
            severity,
            _WORDS[severity],
            _sentence(typeset(finding["message"])),
            "" if severity == "info" else finding["advice"],
            typeset(finding.get("details", "")),
            typeset(lab_report_line(finding)),
            figure if figure in figures else "",
        )
        group = "warnings" if severity != "info" else "standing" if code in STANDING else "notes"
        groups[group].append(notice)
    return groups


def _sentence(text: str) -> str:
    """Start a text with a capital and end it with a full stop."""
    return f"{text[:1].upper()}{text[1:]}{'' if text[-1:] in '.!?' else '.'}"
