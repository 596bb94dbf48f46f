"""Warnings on the terminal: the three most harmful with their advice; errors always."""

from __future__ import annotations

from springmass.terminal.printing import WARNINGS_SHOWN, findings_text

WARNINGS = ("rest_drift", "unit_assumed", "clipped", "spring_mass_missing", "quantised")


def _one(code: str, severity: str, message: str = "", advice: str = "Do it.") -> dict[str, str]:
    return {"code": code, "severity": severity, "message": message or f"words on {code}", "advice": advice}


def test_the_three_most_harmful_warnings_are_shown() -> None:
    """A wrong scale comes before a lost part, and that before a larger uncertainty; the others are counted."""
    lines = findings_text([_one(code, "warning") for code in WARNINGS]).splitlines()
    assert [line.split()[1].rstrip(":") for line in lines[:WARNINGS_SHOWN]] == ["unit_assumed", "clipped", "rest_drift"]
    assert "Do it." in lines[0]
    assert "2 more" in lines[WARNINGS_SHOWN]


def test_errors_are_never_left_out_or_cut() -> None:
    """Of five errors with long messages every word is printed, before the warnings."""
    long = "word " * 80
    text = findings_text([_one("rest_drift", "warning"), *(_one(f"e{i}", "error", long) for i in range(5))])
    assert text.count("word") == 5 * 80 + 1
    assert text.index("e4") < text.index("rest_drift")
