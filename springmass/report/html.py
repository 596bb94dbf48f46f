"""The page of a report: one file that contains its pictures and needs no other files."""

from __future__ import annotations

import base64
import functools
import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from acquisition.errors import visible
from pipeline.analyse import Analysis, Oscillation
from pipeline.numerics.estimate import Estimate
from pipeline.registry.effects import EFFECTS
from pipeline.registry.quantities import INPUTS
from pipeline.track import Track
from springmass.report.advice import notices_of
from springmass.report.budgets import budgets_of, correlations_of
from springmass.report.charts import chart_data
from springmass.report.laws import laws_across, laws_of
from springmass.report.recorded import bench_words, calibration_of, date_words, notes_of, without_date
from springmass.report.tables import page_unit, prefixed, pretty, pretty_number, table_rows
from springmass.report.words import caption, method, typeset, verdict
from springmass.runs.analysing import Analysed
from springmass.runs.comparing import Compared
from springmass.runs.json_results import picked

if TYPE_CHECKING:
    from jinja2 import Template
    from markupsafe import Markup

__all__ = ["render_html"]

_QUALITY = {
    "used": "used",
    "missing": "without a distance",
    "false_echo": "false echoes",
    "clipped": "clipped",
    "duplicate_time": "at a time seen before",
    "non_monotonic_time": "running backward in time",
    "outside": "outside the part that was analysed",
    "malformed_rows": "malformed rows",
}
# Errors of each number of the lab report's method; pipeline.results.classic derives them.
_BIASES = {
    "period": "two sampled maxima decide where a thousand samples could",
    "frequency": "as the period",
    "angular_frequency": "as the period",
    "spring_constant": "as the period, twice over; the spring's mass and the air carried along are left out",
    "amplitude": "extremes of noisy samples lie outside the motion, false echoes enter, clipping shortens",
    "damping_rate": "an exponential tied to one point; overlapping windows count as independent",
    "velocity_rms": "differences of neighbouring distances carry noise, which adds to the mean square",
    "reynolds_number": "as the velocity; air taken at 20 °C without uncertainty",
}


BESIDE = 3  # columns of runs that fit on A4
MOST_NOTES = 50  # maximum number of a recording's notes that the page lists
_SECTIONS = (
    ("position", "Position and residuals", ("position",)),
    ("amplitude", "Amplitude and damping laws", ("amplitude", "logarithmic")),
    ("frequency", "Frequency and spectrum", ("frequency", "spectrum")),
    ("drag", "Effective drag coefficient", ("drag",)),
    ("energy", "Energy", ("energy",)),
    ("motion", "Velocity and acceleration", ("motion",)),
    ("phase", "Phase plot", ("phase",)),
    ("classic", "The lab report's method", ("classic",)),
)
"""Sections of a run in their order: name, title and figures."""
CHARTS = frozenset({"position", "amplitude", "frequency"})
"""Figures that are interactive charts on a screen."""


def render_html(
    runs: Sequence[Analysed],
    pictures: Sequence[Mapping[str, bytes]],
    *,
    compared: Compared | None = None,
    overview: bytes = b"",
    overlay: bytes = b"",
    stems: Sequence[str] = (),
    provenance: Mapping[str, Any],
) -> str:
    """Return the report as one self-contained page.

    Parameters
    ----------
    runs : sequence of Analysed
    pictures : sequence of mapping of str to bytes
        SVG files by figure name, one mapping per run.
    compared : Compared, optional
    overview : bytes
        :func:`springmass.report.figures.comparison_figure` as SVG, if runs were compared.
    overlay : bytes
        :func:`springmass.report.figures.overlay_figure` as SVG, for several runs with the same unit.
    stems : sequence of str
        Prefix of each run's figure files; default: no prefix.
    provenance : mapping
        Shown unchanged, apart from flattening nested mappings.

    Notes
    -----
    The page shows Table 1, the summary and the main figure, then the warnings, then all details in folded sections;
    each fact appears once. The template engine escapes every text; only the pictures and the script, which are made
    here, are inserted unescaped. The numbers of the charts are inserted as JSON, in which no text can end the
    surrounding element.
    """
    from markupsafe import Markup

    from springmass.glossary import TERMS
    from springmass.report.script import report_script, report_style

    numbers = itertools.count(1)
    over = {"address": _address(overlay), "number": next(numbers)} if overlay else None
    comparison = None if compared is None else _compared(compared, overview) | {"number": next(numbers)}
    parts = [
        _part(i, run, drawn, numbers, stem, alone=len(runs) == 1)
        for i, (run, drawn, stem) in enumerate(zip(runs, pictures, stems or [""] * len(runs), strict=True))
    ]
    return template("report.html.j2").render(
        title=", ".join(run.name for run in runs),
        parts=parts,
        tables=list(_tables(runs)),
        overlay=over,
        compared=comparison,
        provenance=list(_flattened(provenance)),
        version=provenance["version"],
        glossary=[term for term in TERMS if not term.of_program],
        charts=CHARTS,
        data=_data(runs),
        script=Markup(report_script()),
        chart_style=Markup(report_style()),
    )


def _data(runs: Sequence[Analysed]) -> dict[str, Any]:
    """Return the data for the script: the numbers of every run's charts, and Table 1 for copying."""
    from springmass.report.copies import table_cells, table_text
    from springmass.report.latex import table_tex

    charts = [chart_data(run.analysis) for run in runs]
    names, analyses = [run.name for run in runs], [run.analysis for run in runs]
    return {
        "runs": [
            {"name": visible(name), "t": data.pop("t"), "data": data} for name, data in zip(names, charts, strict=True)
        ],
        "table": {
            "text": table_text(names, analyses),
            "latex": table_tex(names, analyses),
            "cells": table_cells(names, analyses),
        },
    }


@functools.cache
def template(name: str) -> Template:
    """Return a page's template, cached because compiling the report's template takes as long as drawing a figure."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("springmass.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_shown,
    )
    environment.filters |= {
        "pretty": pretty,
        "number": pretty_number,
        "symbol": _symbol,
        "input": lambda name: INPUTS[name].label,
        "effect": EFFECTS.__getitem__,
        "unit": page_unit,
        "typeset": typeset,
        "breakable": _breakable,
        "aligned": _aligned,
    }
    return environment.get_template(name)


def _shown(value: object) -> object:
    """Make control characters visible in any text that the template inserts, except its own markup."""
    return visible(value) if type(value) is str else value


def _tables(runs: Sequence[Analysed]) -> Iterator[dict[str, Any]]:
    """Yield Table 1 in blocks of as many runs as fit side by side on paper."""
    for first in range(0, len(runs), BESIDE):
        some = runs[first : first + BESIDE]
        rows = [
            replace(row, estimates=tuple(None if x is None else prefixed(x) for x in row.estimates))
            for row in table_rows([run.analysis for run in some], missing=True)
        ]
        widths = [max((len(_split(row.estimates[i])[0]) for row in rows), default=1) for i in range(len(some))]
        yield {"names": [run.name for run in some], "rows": rows, "widths": widths}


def _split(estimate: Estimate | None) -> tuple[str, str]:
    """Split a written estimate into the part before its decimal point and the rest."""
    written = pretty(estimate)
    found = re.match(r"\(?−?\d+", written)
    end = found.end() if found else 0
    return written[:end], written[end:]


def _aligned(estimate: Estimate | None, width: int) -> Markup:
    """Format an estimate so that decimal points are aligned."""
    from markupsafe import Markup

    before, after = _split(estimate)
    return Markup('<span class="whole" style="min-width: {}ch">{}</span>{}').format(width, before, after)


def _part(
    index: int, run: Analysed, pictures: Mapping[str, bytes], numbers: Iterator[int], stem: str, *, alone: bool
) -> dict[str, Any]:
    """Return everything that the template needs about one run."""
    analysis, quality, given = run.analysis, run.result["quality"], run.result["input"]
    motion, title = analysis.motion, str(run.recorded.get("title") or given.get("title") or "")
    ordered = [*(name for name in _QUALITY if name in quality), *(name for name in quality if name not in _QUALITY)]
    main = next((name for name in ("amplitude", "position") if alone and name in pictures), "")
    inside = {name: [x for x in figures if x in pictures and x != main] for name, _, figures in _SECTIONS}
    drawn = [name for name in (main, *itertools.chain(*inside.values())) if name in pictures]
    findings = [picked(x, ("code", "severity", "message", "advice", "details")) for x in analysis.findings]
    part = {
        "name": run.name,
        "index": index,
        "head": [
            _subtitle(title, given, analysis.track, left_out=len(analysis.track) - quality["used"]),
            f"{date_words(run.recorded, title)}.",
            f"Bench: {bench_words(analysis.scene)}.",
            *(f"Noted: {visible(str(note))}" for note in run.recorded.get("notes", ())),
        ],
        "kind": analysis.track.kind,
        "verdict": verdict(analysis),
        "method": method(analysis),
        "main": main,
        "figures": {
            name: {
                "address": _address(pictures[name]),
                "caption": caption(name, analysis),
                "number": next(numbers),
                "id": f"figure-{name}-{index}",
                "file": f"{stem}{name}",
            }
            for name in drawn
        },
        "notices": notices_of(run.result.get("findings", findings), drawn),
        "drawn": inside,
        "laws": laws_of(motion) if isinstance(motion, Oscillation) else None,
        "budgets": budgets_of(analysis),
        "correlations": _correlations(analysis),
        "effects": analysis.effects,
        "quality": [(_QUALITY.get(name, name.replace("_", " ")), quality[name]) for name in ordered],
        "notes": notes_of(run.recorded),
        "most_notes": MOST_NOTES,
        "calibration": calibration_of(run.recorded),
        "classic": _classic_rows(run),
        "chi2": None if run.classic is None else run.classic.chi2,
        "input": list(_flattened(given)),
    }
    return part | {"sections": list(_sections(part))}


def _correlations(analysis: Analysis) -> list[tuple[str, list[str]]]:
    """Return one row per result: its symbol, and its correlations with earlier results and itself."""
    names, matrix = correlations_of(analysis)
    symbols = {row.name: row.page_symbol for row in table_rows([analysis])}
    return [
        (symbols[name], [f"{round(value, 2) + 0.0:.2f}".replace("-", "−") for value in row[: i + 1]])
        for i, (name, row) in enumerate(zip(names, matrix, strict=True))
    ]


def _sections(part: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield (id, title) of the non-empty sections of a run."""
    if part["method"]:
        yield f"method-{part['index']}", "For your lab report"
    filled = {"amplitude": part["laws"], "motion": part["laws"], "classic": part["classic"]}
    for name, title, _ in _SECTIONS:
        if part["drawn"][name] or filled.get(name) is not None:
            yield f"{name}-{part['index']}", title
    for name, title in (("budgets", "Uncertainty"), ("effects", "Effects")):
        if part[name]:
            yield f"{name}-{part['index']}", title
    yield f"samples-{part['index']}", "Samples and recording"


def _subtitle(title: str, given: Mapping[str, Any], track: Track, *, left_out: int) -> str:
    duration_s = float(track.t[-1] - track.t[0])
    parts = [
        without_date(title),
        f"{len(track)} samples ({left_out} left out) at {track.rate_hz:g} Hz, {duration_s:.1f} s",
        f"format {given['format']}" if given.get("format") else None,
    ]
    return " · ".join(str(part) for part in parts if part) + "."


def _classic_rows(run: Analysed) -> list[dict[str, Any]] | None:
    if run.classic is None:
        return None
    words = {row.name: row for row in table_rows([run.analysis])}
    return [
        {
            "quantity": words[name].quantity if name in words else name.replace("_", " "),
            "here": run.analysis.estimates.get(name),
            "classic": estimate,
            "bias": _BIASES.get(name, ""),
        }
        for name, estimate in run.classic.estimates.items()
    ]


def _compared(compared: Compared, overview: bytes) -> dict[str, Any]:
    """Return everything that the template needs about the comparison."""
    found = compared.comparison
    return {
        "found": found,
        "message": typeset(found.message),
        "findings": [picked(x, ("code", "severity", "advice")) for x in compared.findings],
        "rows": list(zip(found.names, found.each, found.pulls, strict=True)),
        "figure": _address(overview),
        "joint": [laws_across(joint) for joint in compared.joint],
    }


def _address(svg: bytes) -> str:
    """Return a picture as a data URL, so that the page is one file."""
    return f"data:image/svg+xml;base64,{base64.b64encode(svg).decode()}"


def _flattened(tree: Mapping[str, Any], above: str = "") -> list[tuple[str, str]]:
    """Return (dotted name, text) of every leaf."""
    leaves: list[tuple[str, str]] = []
    for key, value in tree.items():
        name = f"{above}.{key}" if above else str(key)
        if isinstance(value, Mapping):
            leaves += _flattened(value, name)
        elif value is not None:
            leaves.append((name, " ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)))
    return leaves


def _symbol(symbol: str) -> Markup:
    """Format a symbol, with the index that follows a space as a subscript."""
    from markupsafe import Markup, escape

    letter, mark, index = symbol.partition(" ")
    return (
        Markup("<i>{}</i><sub>{}</sub>").format(letter, index)
        if mark
        else Markup("<i>") + escape(letter) + Markup("</i>")
    )


def _breakable(law: str) -> Markup:
    """Allow a line break after each plus in the name of a law."""
    from markupsafe import Markup, escape

    return Markup("+<wbr>").join(escape(term) for term in law.split("+"))
