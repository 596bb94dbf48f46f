"""Summaries of a run: at most 15 lines for a terminal, and page-wide HTML for a notebook."""

from __future__ import annotations

import math
import textwrap
from collections import Counter
from collections.abc import Callable, Mapping
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from acquisition.errors import visible
from pipeline.analyse import Oscillation
from pipeline.damping.joint import JointDamping
from pipeline.damping.select import Damping
from pipeline.numerics.estimate import Estimate
from springmass.typeset import equation, law_status, pretty, pretty_number, typeset

if TYPE_CHECKING:
    from springmass.runs.run import Run

SUMMARY_WIDTH = 79
SUMMARY_ROWS = 10
# Quantities that the text summary may show, in this order; it shows at most SUMMARY_ROWS of them.
SUMMARY_ORDER = (
    "period", "spring_constant", "amplitude", "damping_rate", "relaxation_rate", "relaxation_rate_slow",
    "relaxation_rate_fast", "gamma", "beta", "mu", "c", "n", "offset", "noise", "quality_factor", "drag_coefficient",
)  # fmt: skip


def text_summary(run: Run) -> str:
    """Return a run in at most 15 lines of at most 79 characters."""
    rows = {row.name: row for row in run.rows}
    shown = [name for name in SUMMARY_ORDER if name in rows][:SUMMARY_ROWS]
    lines = [_cut(visible(_head(run)))]
    width = max((len(rows[name].quantity) for name in shown), default=0) + 2
    lines += [f"  {rows[name].quantity:{width}}{rows[name].symbol:8}{rows[name].estimates[0]!r}" for name in shown]
    if isinstance(run.analysis.motion, Oscillation):
        lines.append(_cut(f"damping: {_law(run.analysis.motion)}"))
    lines.append(_cut(_findings(run)))
    hidden = len(rows) - len(shown)
    lines.append("to_dataframe() has all estimates" + (f" ({hidden} more)" if hidden else "") + ", plot() the run")
    return "\n".join(lines)


def html_summary(run: Run) -> str:
    """Return a run as an HTML fragment without scripts: estimates, laws and findings."""
    motion = run.analysis.motion
    rows = [
        f"<tr><td>{escape(row.quantity)}</td><td><i>{_subscript(row.page_symbol)}</i></td>"
        f"<td>{escape(pretty(row.estimates[0]))}</td></tr>"
        for row in run.rows
    ]
    parts = [
        f"<p><b>{escape(visible(_head(run)))}</b></p>",
        "<table><thead><tr><th>quantity</th><th>symbol</th><th>estimate</th></tr></thead>"
        f"<tbody>{''.join(rows)}</tbody></table>",
    ]
    if isinstance(motion, Oscillation):
        fits = [
            f"<tr><td>{escape(row['name'])}</td><td>{escape(row['status'])}</td>"
            f"<td>{pretty_number(row['fit'].reduced_chi2, 3)}</td><td>{escape(row['bic'])}</td>"
            f"<td>{escape(', '.join(row['coefficients'][1:]))}</td></tr>"
            for row in laws_of(motion)["rows"]
        ]
        heads = "<th>law</th><th>status</th><th>reduced χ²</th><th>ΔBIC</th><th>coefficients</th>"
        parts.append(
            f"<details><summary>Damping: {escape(_law(motion))}</summary>"
            f"<table><thead><tr>{heads}</tr></thead><tbody>{''.join(fits)}</tbody></table></details>"
        )
    items = "".join(
        f"<li><b>{escape(f.severity)}</b> <code>{escape(f.code)}</code>: {escape(visible(f.message))}</li>"
        for f in run.findings
    )
    opened = " open" if any(f.severity != "info" for f in run.findings) else ""
    parts.append(f"<details{opened}><summary>{escape(_findings(run))}</summary><ul>{items}</ul></details>")
    return f'<div class="springmass-analysis">{"".join(parts)}</div>'


def _head(run: Run) -> str:
    track = run.analysis.track
    span = float(np.nanmax(track.t) - np.nanmin(track.t))
    words = f"{run.name or 'run'}: {track.kind}, {len(track)} samples in {span:.4g} s, "
    words += f"{run.analysis.quality['used']} used"
    return f"{words}; {run.why}" if run.why else words


def _law(motion: Oscillation) -> str:
    damping = motion.damping
    others = [name for name in damping.admissible if name != damping.selected]
    if damping.by_statement:
        return f"{damping.selected} ({law_status(damping, damping.selected)})"
    state = "rejected, yet the least bad" if damping.best.rejected else "selected"
    tail = f"; {', '.join(others)} cannot be distinguished from it" if others else ""
    return f"{damping.selected} ({state} of {len(damping.fits)} laws){tail}"


def _findings(run: Run) -> str:
    counts: Counter[str] = Counter(finding.severity for finding in run.findings)
    parts = [f"{counts[name]} {name}{'s' * (counts[name] > 1)}" for name in ("error", "warning") if counts[name]]
    parts += [f"{counts['info']} for information"] if counts["info"] else []
    grave = [f.code for f in run.findings if f.severity != "info"]
    return f"findings: {', '.join(parts) or 'none'}" + (f": {', '.join(grave)}" if grave else "")


def _cut(line: str) -> str:
    return textwrap.shorten(line, SUMMARY_WIDTH, placeholder=" ...")


def _subscript(symbol: str) -> str:
    letter, _, index = symbol.partition(" ")
    return escape(letter) + (f"<sub>{escape(index)}</sub>" if index else "")


def laws_of(motion: Oscillation) -> dict[str, Any]:
    """Return the rows of all laws fitted to one run, and the reasons why other laws were not fitted."""
    damping = motion.damping
    fitted = {law: motion.derived.parameters_of(fit) for law, fit in damping.fits.items()}
    laws = _laws(damping, fitted, lambda law: law_status(damping, law))
    return {**laws, "unfitted": [(law, typeset(why)) for law, why in damping.unfitted.items()]}


def laws_across(joint: JointDamping) -> dict[str, Any]:
    """Return the rows of all laws fitted to several runs with shared coefficients, and the conclusion in words."""
    fitted = {law: fit.coefficients for law, fit in joint.fits.items()}
    return {
        "message": typeset(joint.message),
        "unfitted": [],
        **_laws(joint, fitted, lambda law: _joint_status(joint, law)),
    }


def _laws(
    found: Damping | JointDamping, fitted: Mapping[str, Mapping[str, Estimate]], status: Callable[[str], str]
) -> dict[str, Any]:
    """Return one row per fitted law: goodness of fit, status and coefficients."""
    chi2 = found.best.reduced_chi2 * found.best.dof
    rows = [
        {
            "name": law,
            "status": status(law),
            "look": "rejected" if fit.rejected else "selected" if law == found.selected else "",
            "fit": fit,
            "chi2": _difference(fit.reduced_chi2 * fit.dof - chi2),
            "bic": _difference(fit.bic - found.best.bic),
            "coefficients": [equation(name, x) for name, x in fitted[law].items()],
        }
        for law, fit in found.fits.items()
    ]
    return {"rows": rows}


def _difference(value: float) -> str:
    if not math.isfinite(value):  # chi-square of a law with as many parameters as there are windows
        return pretty_number(None)
    return pretty_number(value) if abs(value) >= 1000.0 else f"{value:.1f}".replace("-", "−")


def _joint_status(joint: JointDamping, law: str) -> str:
    rejection = joint.fits[law].rejection
    if rejection:
        return {"differ": "coefficients differ"}.get(rejection, rejection)
    if law == joint.selected:
        return "selected"
    return "admissible" if law in joint.admissible else "unlikely"
