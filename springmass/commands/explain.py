"""``springmass explain``: what a finding means, what causes it, what to do, and an example."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from difflib import get_close_matches

from pipeline.findings.examples import EXAMPLES
from pipeline.findings.registry import FINDINGS, FindingKind
from springmass.errors import OK, USAGE, ProgramError
from springmass.options import JsonOption
from springmass.terminal.printing import wrapped

__all__ = ["run"]

COLUMNS = 80
INDENT = " " * 9


def run(codes: Sequence[str], options: JsonOption) -> int:
    """Print each finding asked for; without a code, every code with its meaning by symptom."""
    for code in codes:
        if code not in FINDINGS:
            near = get_close_matches(code, FINDINGS, n=1)
            hint = f"did you mean {near[0]}?" if near else "springmass explain lists all codes"
            raise ProgramError(f"there is no finding {code!r}; {hint}", USAGE)
    if options.json:
        print(json.dumps([_fields(code, FINDINGS[code]) for code in codes or FINDINGS]))
    elif codes:
        print("\n\n".join(_explained(code, FINDINGS[code]) for code in codes))
    else:
        print(_listed(FINDINGS))
    return OK


def _fields(code: str, kind: FindingKind) -> dict[str, object]:
    return {
        "code": code,
        "severities": list(kind.severities),
        "symptom": kind.symptom.value,
        "meaning": kind.meaning,
        "cause": kind.cause,
        "advice": kind.advice,
        "example": EXAMPLES[code],
        "figure": kind.figure,
    }


def _explained(code: str, kind: FindingKind) -> str:
    severity = " or ".join("note" if each == "info" else each for each in kind.severities)
    rows = [
        ("Meaning", kind.meaning),
        ("Cause", kind.cause),
        ("Advice", kind.advice or "Nothing needs doing."),
        ("Example", EXAMPLES[code]),
    ]
    if kind.figure:
        rows.append(("Figure", f"The {kind.figure} figure of the report shows it."))
    lines = [f"{code} ({severity}; {kind.symptom.value.lower()})"]
    return "\n".join([*lines, *(wrapped(f"{name + ':':<9}{text}", INDENT, COLUMNS) for name, text in rows)])


def _listed(findings: Mapping[str, FindingKind]) -> str:
    groups: dict[str, list[str]] = {}
    for code, kind in findings.items():
        groups.setdefault(kind.symptom.value, []).append(wrapped(f"  {code}: {kind.meaning}", " " * 6, COLUMNS))
    return "\n\n".join("\n".join([symptom, *lines]) for symptom, lines in groups.items())
