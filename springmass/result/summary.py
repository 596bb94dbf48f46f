"""Short summaries of a run: at most 15 lines for a terminal, and an HTML fragment for a notebook."""

from __future__ import annotations

import textwrap
from collections import Counter
from html import escape

import numpy as np

from acquisition.errors import visible
from pipeline.analyse import Analysis
from pipeline.damping.select import Damping
from springmass.result.law_rows import laws_of
from springmass.result.table1 import table_rows
from springmass.typeset import law_status, pretty, pretty_number

SUMMARY_WIDTH = 79
SUMMARY_ROWS = 10
# Quantities that the text summary may show, in this order; it shows at most SUMMARY_ROWS of them.
SUMMARY_ORDER = (
    "period", "spring_constant", "amplitude", "damping_rate", "relaxation_rate", "relaxation_rate_slow",
    "relaxation_rate_fast", "gamma", "beta", "mu", "c", "n", "offset", "noise", "quality_factor", "drag_coefficient",
)  # fmt: skip


def text_summary(analysis: Analysis, name: str) -> str:
    """Return a run in at most 15 lines of at most 79 characters."""
    rows = {row.name: row for row in table_rows([analysis])}
    shown = [rows[quantity] for quantity in SUMMARY_ORDER if quantity in rows][:SUMMARY_ROWS]
    lines = [_cut(visible(_head(analysis, name)))]
    width = max((len(row.quantity) for row in shown), default=0) + 2
    lines += [f"  {row.quantity:{width}}{row.symbol:8}{row.estimates[0]!r}" for row in shown]
    if analysis.damping.fits:
        lines.append(_cut(f"damping: {_law(analysis.damping)}"))
    lines.append(_cut(_findings(analysis)))
    hidden = len(rows) - len(shown)
    lines.append("to_dataframe() has all estimates" + (f" ({hidden} more)" if hidden else "") + ", plot() the run")
    return "\n".join(lines)


def html_summary(analysis: Analysis, name: str) -> str:
    """Return a run as an HTML fragment without scripts: estimates, laws and findings."""
    rows = [
        f"<tr><td>{escape(row.quantity)}</td><td>{symbol(row.page_symbol)}</td>"
        f"<td>{escape(pretty(row.estimates[0]))}</td></tr>"
        for row in table_rows([analysis])
    ]
    parts = [
        f"<p><b>{escape(visible(_head(analysis, name)))}</b></p>",
        "<table><thead><tr><th>quantity</th><th>symbol</th><th>estimate</th></tr></thead>"
        f"<tbody>{''.join(rows)}</tbody></table>",
    ]
    if analysis.damping.fits:
        fits = [
            f"<tr><td>{escape(row['name'])}</td><td>{escape(row['status'])}</td>"
            f"<td>{pretty_number(row['fit'].reduced_chi2, 3)}</td><td>{escape(row['bic'])}</td>"
            f"<td>{escape(', '.join(row['coefficients'][1:]))}</td></tr>"
            for row in laws_of(analysis)["rows"]
        ]
        heads = "<th>law</th><th>status</th><th>reduced χ²</th><th>ΔBIC</th><th>coefficients</th>"
        parts.append(
            f"<details><summary>Damping: {escape(_law(analysis.damping))}</summary>"
            f"<table><thead><tr>{heads}</tr></thead><tbody>{''.join(fits)}</tbody></table></details>"
        )
    items = "".join(
        f"<li><b>{escape(f.severity)}</b> <code>{escape(f.code)}</code>: {escape(visible(f.message))}</li>"
        for f in analysis.findings
    )
    opened = " open" if any(f.severity != "info" for f in analysis.findings) else ""
    parts.append(f"<details{opened}><summary>{escape(_findings(analysis))}</summary><ul>{items}</ul></details>")
    return f'<div class="springmass-analysis">{"".join(parts)}</div>'


def _head(analysis: Analysis, name: str) -> str:
    track = analysis.track
    span = float(np.nanmax(track.t) - np.nanmin(track.t))
    words = f"{name or 'run'}: {track.kind}, {len(track)} samples in {span:.4g} s, "
    words += f"{analysis.quality['used']} used"
    return words if analysis.ok else f"{words}; {analysis.why}"


def _law(damping: Damping) -> str:
    others = [name for name in damping.possible if name != damping.selected]
    if damping.by_statement:
        return f"{damping.selected} ({law_status(damping, damping.selected)})"
    state = "rejected, yet the least bad" if damping.best.rejected else "selected"
    tail = f"; {', '.join(others)} cannot be distinguished from it" if others else ""
    return f"{damping.selected} ({state} of {len(damping.fits)} laws){tail}"


def _findings(analysis: Analysis) -> str:
    counts: Counter[str] = Counter(finding.severity for finding in analysis.findings)
    parts = [f"{counts[name]} {name}{'s' * (counts[name] > 1)}" for name in ("error", "warning") if counts[name]]
    parts += [f"{counts['info']} for information"] if counts["info"] else []
    grave = [f.code for f in analysis.findings if f.severity != "info"]
    return f"findings: {', '.join(parts) or 'none'}" + (f": {', '.join(grave)}" if grave else "")


def _cut(line: str) -> str:
    return textwrap.shorten(line, SUMMARY_WIDTH, placeholder=" ...")


def symbol(page_symbol: str) -> str:
    """Return a symbol as HTML, with its index lowered."""
    letter, _, index = page_symbol.partition(" ")
    return f"<i>{escape(letter)}</i>" + (f"<sub>{escape(index)}</sub>" if index else "")
