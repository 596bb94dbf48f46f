"""``springmass explain``: what a finding means, what causes it, what to do, and an example."""

import json
from difflib import get_close_matches
from typing import Annotated

from pipeline.findings.finding import FindingKind, kinds, usual_advice, word
from pipeline.notice import Notice
from springmass.commands.options import Json
from springmass.commands.parameters import argument
from springmass.errors import OK, ProgramError
from springmass.terminal.printing import with_options, wrapped

PAGE_WIDTH = 80
EXPLANATION_INDENT = " " * 9


def explain(
    codes: Annotated[tuple[str, ...], argument("CODE", "codes of warnings, as analyse prints them")] = (),
    /,
    *,
    as_json: Json = False,
) -> int:
    """Print each finding asked for; without a code, every code with its meaning by symptom."""
    all_kinds = kinds()
    for code in codes:
        if code not in all_kinds:
            near = get_close_matches(code, all_kinds, n=1)
            hint = f"did you mean {near[0]}?" if near else "springmass explain lists all codes"
            raise ProgramError(f"there is no finding {code!r}", hint)
    if as_json:
        print(json.dumps([_fields(code, all_kinds[code]) for code in codes or all_kinds]))
    elif codes:
        print("\n\n".join(_explained(code, all_kinds[code]) for code in codes))
    else:
        groups: dict[str, list[str]] = {}
        for code, kind in all_kinds.items():
            groups.setdefault(kind.symptom, []).append(wrapped(f"  {code}: {kind.meaning}", " " * 6, PAGE_WIDTH))
        print("\n\n".join("\n".join([symptom, *lines]) for symptom, lines in groups.items()))
    return OK


def _fields(code: str, kind: FindingKind) -> dict[str, object]:
    return {
        "code": code,
        "severities": list(kind.severity),
        "symptom": kind.symptom,
        "meaning": kind.meaning,
        "cause": kind.cause,
        "advice": with_options(code, usual_advice(code)),
        "example": word(Notice(code, kind.example)).message,
        "figure": kind.figure,
    }


def _explained(code: str, kind: FindingKind) -> str:
    severity = " or ".join("note" if each == "info" else each for each in kind.severity)
    rows = [
        ("Meaning", kind.meaning),
        ("Cause", kind.cause),
        ("Advice", with_options(code, usual_advice(code)) or "Nothing needs doing."),
        ("Example", word(Notice(code, kind.example)).message),
    ]
    if kind.figure:
        rows.append(("Figure", f"The {kind.figure} figure of the report shows it."))
    lines = [f"{code} ({severity}; {kind.symptom.lower()})"]
    return "\n".join(
        [*lines, *(wrapped(f"{name + ':':<9}{text}", EXPLANATION_INDENT, PAGE_WIDTH) for name, text in rows)]
    )
