"""Words for the terminal: findings and the classic method's numbers, wrapped to its width."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pipeline.classic import Classic

__all__ = ["classic_text", "findings_text"]

_MARKS = {"error": "ERROR  ", "warning": "warning", "info": "note   "}


def findings_text(findings: Sequence[Mapping[str, Any]]) -> str:
    """Return findings as wrapped lines, each with its severity and code.

    Parameters
    ----------
    findings : sequence of mapping
        As in the result's JSON: code, severity, message.
    """
    if not findings:
        return "No findings."
    return "\n".join(_entry(f["severity"], f["code"], f["message"]) for f in findings)


def classic_text(classic: Classic) -> str:
    """Return the report's own numbers, marked as what they are."""
    lines = ["By the report's own method (biased, for comparison only; --help names the page on it):"]
    lines += [f"  {name.replace('_', ' '):<22} {estimate}" for name, estimate in classic.estimates.items()]
    return "\n".join([*lines, f"  {'chi-square of its fit':<22} {classic.chi2:.4g}"])


def _entry(severity: str, code: str, message: str) -> str:
    width = min(shutil.get_terminal_size((100, 24)).columns, 100)
    return textwrap.fill(
        f"{_MARKS[severity]} {code}: {message}", width, subsequent_indent=" " * 8, break_on_hyphens=False
    )
