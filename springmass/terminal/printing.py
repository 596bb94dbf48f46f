"""Words for the terminal: findings, a comparison, the classic method's numbers, wrapped to its width."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from acquisition.errors import visible
from pipeline.analyse import Analysis, Oscillation
from pipeline.results.classic import Classic
from pipeline.results.compare import Comparison

__all__ = [
    "classic_text",
    "comparison_text",
    "findings_text",
    "fitted",
    "shared_findings_text",
    "visible_lines",
    "wrapped",
]

_MARKS = {"error": "ERROR  ", "warning": "warning", "info": "note   "}
STANDING = ("nominal_clock", "stated_error_is_not_noise", "jittered_time", "offset_unknown", "velocity_missing")
"""Notes that a format makes on every file of its own: they drown what this record says."""
NAMED = 5  # runs that a line names
FIRST = 3  # that change a number stand by themselves


def findings_text(findings: Sequence[Mapping[str, Any]], written: Callable[[str], str] = str) -> str:
    """Return findings as wrapped lines, each with its severity and code.

    Parameters
    ----------
    findings : sequence of mapping
        As in the result's JSON: code, severity, message.
    written : callable
        How a message is written on this terminal.
    """
    if not findings:
        return "No findings."
    standing = [f["code"] for f in findings if f["code"] in STANDING and f["severity"] == "info"]
    own = [f for f in findings if f["code"] not in standing]
    told = [f"{_MARKS[f['severity']]} {f['code']}: {written(f['message'])}" for f in own]
    grave = sum(f["severity"] != "info" for f in own)
    lines = [wrapped(one, " " * 8) for one in told]
    if grave > FIRST:
        lines.insert(FIRST, f"and {grave - FIRST} more that may change a number:")
    if standing:
        words = f"{_MARKS['info']} of the format, as of every file of its kind: {', '.join(standing)} (findings.md)"
        lines.append(wrapped(words, " " * 8))
    return "\n".join(lines)


def shared_findings_text(runs: Mapping[str, Sequence[Mapping[str, Any]]], written: Callable[[str], str] = str) -> str:
    """Return the findings of several runs that change a number, a paragraph a code, and how many notes there are.

    Parameters
    ----------
    runs : mapping
        By name of the run, its findings as in the result's JSON.
    written : callable
        How a message is written on this terminal.
    """
    grave: dict[str, dict[str, Mapping[str, Any]]] = {}
    notes = 0
    for name, findings in runs.items():
        notes += sum(f["severity"] == "info" for f in findings)
        for f in findings:
            if f["severity"] != "info":
                grave.setdefault(f["code"], {})[name] = f
    lines = []
    for code, by_run in sorted(grave.items(), key=lambda item: min(f["severity"] for f in item[1].values())):
        names = [visible(name) for name in by_run]
        told = ", ".join(names[:NAMED]) + (f" and {len(names) - NAMED} more" if len(names) > NAMED else "")
        first = next(iter(by_run.values()))
        head = f"{_MARKS[first['severity']]} {code}, {len(names)} of {len(runs)} runs ({told}): "
        lines.append(wrapped(f"{head}{'' if len(names) == 1 else 'the first: '}{written(first['message'])}", " " * 8))
    lines.append(f"{notes} notes, which change no number: --json has them.")
    return "\n".join(lines)


def classic_text(classic: Classic) -> str:
    """Return the report's own numbers, marked as what they are."""
    lines = ["By the report's own method (biased, for comparison only; --help names the page on it):"]
    lines += [f"  {name.replace('_', ' '):<22} {estimate}" for name, estimate in classic.estimates.items()]
    return "\n".join([*lines, f"  {'chi-square of its fit':<22} {classic.chi2:.4g}"])


def comparison_text(comparison: Comparison, analyses: Sequence[Analysis]) -> str:
    """Return a comparison as an aligned table in ASCII, and what it says in words.

    Parameters
    ----------
    comparison : Comparison
    analyses : sequence of Analysis
        Of its runs, in their order.
    """
    rows = [("run", "period", "mass that swings", "spring constant", "residual / u")]
    for name, analysis, k, pull in zip(comparison.names, analyses, comparison.each, comparison.pulls, strict=True):
        mass = analysis.motion.derived.effective_mass_kg if isinstance(analysis.motion, Oscillation) else None
        period = str(analysis.estimates["period"])
        rows.append((visible(name).encode("ascii", "replace").decode(), period, str(mass), str(k), f"{pull:+.1f}"))
    # Of constants that disagree there is no mean to give.
    mean = str(comparison.spring_constant) if comparison.agree else "none"
    rows.append(("together", "", "", mean, f"chi2 {comparison.chi2:.3g} / {comparison.dof}"))
    widths = [max(len(row[i]) for row in rows) for i in range(5)]
    lines = ["   ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows]
    lines.insert(1, "-" * len(lines[0]))
    return "\n".join([*lines, "", wrapped(comparison.message)])


def wrapped(text: str, indent: str = "") -> str:
    """Return text wrapped to the terminal, at most a hundred columns, lines after the first indented."""
    width = min(shutil.get_terminal_size((100, 24)).columns, 100)
    shown = visible(" ".join(text.splitlines()))
    return textwrap.fill(shown, width, subsequent_indent=indent, break_on_hyphens=False)


def fitted(text: str, width: int) -> str:
    """Return lines broken between words where they are wider than a terminal."""
    return "\n".join(textwrap.fill(line, width, subsequent_indent="    ") for line in text.splitlines())


def visible_lines(text: str) -> str:
    """Return text from outside with its control characters visible, lines kept."""
    return "\n".join(map(visible, text.splitlines()))
