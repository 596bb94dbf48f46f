"""Findings on the terminal: what changes a number first, a format's standing notes in one line."""

from __future__ import annotations

from springmass.terminal.printing import FIRST, findings_text


def _one(code: str, severity: str) -> dict[str, str]:
    return {"code": code, "severity": severity, "message": f"words on {code}"}


def test_standing_notes_of_a_format_are_one_line() -> None:
    """What every file of a format would be told is named by its codes alone, after all else."""
    text = findings_text([_one("rest_drift", "warning"), _one("nominal_clock", "info"), _one("offset_unknown", "info")])
    assert text.splitlines()[0] == "warning rest_drift: words on rest_drift"
    assert "words on nominal_clock" not in text
    assert text.splitlines()[-1].endswith("nominal_clock, offset_unknown (findings.md)")


def test_three_findings_that_change_a_number_stand_by_themselves() -> None:
    """What follows the first three is counted."""
    text = findings_text([_one(f"code{i}", "warning") for i in range(FIRST + 2)])
    assert text.splitlines()[FIRST] == "and 2 more that may change a number:"
    assert len(text.splitlines()) == FIRST + 3


def test_no_findings_are_said() -> None:
    """An empty list is not an empty text."""
    assert findings_text([]) == "No findings."
