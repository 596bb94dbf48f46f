"""Warnings on the terminal: the most harmful three with their advice, everything with ``--full``, errors always."""

from __future__ import annotations

from springmass.terminal.printing import FIRST, NARROW, WARNING_LINES, findings_text

WARNINGS = ("rest_drift", "unit_assumed", "clipped", "spring_mass_missing", "quantised")


def _one(code: str, severity: str, message: str = "", advice: str = "Do it.") -> dict[str, str]:
    return {"code": code, "severity": severity, "message": message or f"words on {code}", "advice": advice}


def test_the_three_most_harmful_warnings_are_shown() -> None:
    """A wrong scale comes before a lost part, and that before a larger uncertainty; the others are counted."""
    lines = findings_text([_one(code, "warning") for code in WARNINGS]).splitlines()
    assert [line.split()[1].rstrip(":") for line in lines[:FIRST]] == ["unit_assumed", "clipped", "rest_drift"]
    assert lines[0] == "warning unit_assumed: words on unit_assumed. Do it."
    assert lines[FIRST:] == ["and 2 more warnings: --full"]


def test_errors_are_never_left_out_or_cut() -> None:
    """Of five errors with long messages every word is printed, before the warnings."""
    long = "word " * 80
    text = findings_text([_one("rest_drift", "warning"), *(_one(f"e{i}", "error", long) for i in range(5))])
    assert text.count("word") == 5 * 80 + 1
    assert text.index("e4") < text.index("rest_drift")


def test_a_warning_takes_three_lines_of_eighty_columns() -> None:
    """A longer one ends in dots."""
    lines = findings_text([_one("rest_drift", "warning", "word " * 80)]).splitlines()
    assert len(lines) == WARNING_LINES
    assert max(map(len, lines)) <= NARROW
    assert lines[-1].endswith("...")


def test_everything_is_printed_in_full() -> None:
    """Notes come last; those that every file of a format has are one line."""
    notes = [_one("false_echoes", "info"), _one("nominal_clock", "info"), _one("offset_unknown", "info")]
    text = findings_text([*notes, *(_one(code, "warning") for code in WARNINGS)], full=True)
    assert all(code in text for code in WARNINGS)
    assert "note    false_echoes: words on false_echoes" in text
    assert "words on nominal_clock" not in text
    assert "of every file of this format: nominal_clock, offset_unknown" in text


def test_no_warnings_are_said() -> None:
    """An empty list is not an empty text, and notes are no warnings."""
    assert findings_text([]) == "No warnings."
    assert findings_text([_one("nominal_clock", "info")]) == "No warnings."
