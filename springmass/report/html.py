"""The page of a report: one file that contains its charts and needs no other files."""

from __future__ import annotations

import base64
import functools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from acquisition.errors import visible
from pipeline.findings.finding import kinds
from pipeline.numerics.estimate import Estimate
from pipeline.quantities import EFFECTS, INPUTS, QUANTITIES
from pipeline.track import Track
from springmass.charts.browser import chart_style, report_script
from springmass.charts.chart import Chart, to_json
from springmass.comparing.comparison import SpringComparison
from springmass.report.recorded import bench_words, calibration_of, date_words, notes_of
from springmass.report.words import method, summary, verdict
from springmass.result.advice import SEVERITY_WORDS, notices_of
from springmass.result.budget_tables import budgets_of, correlations_of
from springmass.result.grades import grades_of
from springmass.result.law_rows import laws_across, laws_of
from springmass.result.summary import symbol
from springmass.result.table1 import is_about, rows_and_needs, table_rows
from springmass.runs.run import Run
from springmass.typeset import MANY_FREEDOM, cells, count, page_unit, prefixed, pretty, pretty_number, typeset

if TYPE_CHECKING:
    from jinja2 import Template
    from markupsafe import Markup

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
BESIDE = 3  # columns of runs that fit on A4
MOST_NOTES = 50  # of a recording that the page lists
SHARED = "charts.js"
"""The name of the script's own file, where several reports share it."""


@dataclass(slots=True)
class Figures:
    """The charts of a page in the order of their numbers, and their pictures if they were asked for."""

    pictures: Mapping[str, bytes] = field(default_factory=dict)  # SVG by the name of the file without its suffix
    charts: list[dict[str, Any]] = field(default_factory=list)

    def add(self, chart: Chart, stem: str = "", index: int = 0) -> dict[str, Any]:
        """Take a chart; return what the template needs about it."""
        self.charts.append(to_json(chart) | {"file": f"{stem}{chart.name}"})
        svg = self.pictures.get(f"{stem}{chart.name}")
        return {
            "id": f"figure-{chart.name}-{index}",
            "number": len(self.charts),
            "name": chart.name,
            "title": chart.title,
            "caption": chart.caption,
            "picture": svg and f"data:image/svg+xml;base64,{base64.b64encode(svg).decode()}",
        }


def render_html(
    runs: Sequence[Run],
    charts: Mapping[str, Mapping[str, Chart]],
    *,
    compared: SpringComparison | None = None,
    several: Mapping[str, Chart],
    pictures: Mapping[str, bytes],
    provenance: Mapping[str, Any],
    script: str = "",
) -> str:
    """Return the report as one page, which contains its script, or refers to it if it has an address.

    ``charts`` are those of each run, by the prefix of the names of its figures, and ``several`` those of all runs. The
    template engine escapes every text; only scripts and styles, which are made here, are inserted unescaped. Numbers of
    charts are JSON, in which no text can end the surrounding element.
    """
    figures = Figures(pictures)
    overview = {name: figures.add(chart) for name, chart in several.items()}
    parts = [
        _part(i, run, of_run, figures, stem)
        for i, (run, (stem, of_run)) in enumerate(zip(runs, charts.items(), strict=True))
    ]
    return template("report.html.j2").render(
        title=", ".join(run.name for run in runs),
        parts=parts,
        tables=list(tables_of(runs)),
        several=overview,
        compared=compared,
        of_reported={code for code, kind in kinds().items() if "reported" in kind.about},
        reported="" if compared is None else _reported_words(compared),
        periods={run.name: (run["period"], run.analysis.derived.effective_mass_kg) for run in runs if run.ok},
        verdict="" if compared is None else " ".join(verdict(compared)),
        joint=() if compared is None else [laws_across(joint) for joint in compared.joint],
        provenance=list(_flattened(provenance)),
        version=provenance["version"],
        many=MANY_FREEDOM,
        **drawn_by_script(figures.charts, script),
    )


def drawn_by_script(charts: Sequence[Mapping[str, Any]], address: str = "") -> dict[str, Any]:
    """Return what a template needs to draw charts: their numbers, the style, and the script or its address."""
    script = "" if address else report_script()
    return {"charts": charts, "chart_style": chart_style(), "script": script, "script_address": address}


def page_style() -> str:
    """Return the style that all reports share, and the window."""
    return Path(__file__).with_name("templates").joinpath("page.css").read_text("utf-8")


@functools.cache
def template(name: str) -> Template:
    """Return a page's template, cached because compiling the report's takes as long as an analysis of ten seconds."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("springmass.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        # Control characters are made visible in any text that the template inserts, except its own markup.
        finalize=lambda value: visible(value) if type(value) is str else value,
    )
    environment.filters |= {
        "pretty": pretty,
        "cells": cells,
        "number": pretty_number,
        "input": lambda name: INPUTS[name].label,
        "effect": EFFECTS.__getitem__,
        "unit": page_unit,
        "typeset": typeset,
        "indexed": _indexed,
        "symbol": symbol,
        "word": SEVERITY_WORDS.__getitem__,
    }
    return environment.get_template(name)


def _reported_words(compared: SpringComparison) -> str:
    """Return how many of the values that somebody printed agree, and which mistakes explain the others."""
    if not compared.reported:
        return ""
    agree = sum(row.verdict.startswith("agrees") for row in compared.reported)
    mistakes = [f for f in compared.findings if "reported" in kinds()[f.code].about]
    errors = [typeset(f.message) for f in mistakes if f.severity == "error"]
    text = " ".join([f"{agree} of {count(len(compared.reported), 'printed value')} agree.", *errors])
    return f"{text} {count(len(mistakes) - len(errors), 'warning')} below." if len(mistakes) > len(errors) else text


_INDEXES = [q.page_symbol.replace(" ", "_") for q in QUANTITIES.values() if " " in q.page_symbol]
SYMBOL_WITH_INDEX = re.compile(rf"\b({'|'.join(_INDEXES)})\b")


def _indexed(text: str) -> Markup:
    """Set the indexes of symbols lower in a sentence, as in T_s."""
    from markupsafe import Markup, escape

    return Markup(
        SYMBOL_WITH_INDEX.sub(lambda found: "{}<sub>{}</sub>".format(*found[0].split("_")), str(escape(visible(text))))
    )


def tables_of(runs: Sequence[Run]) -> Iterator[dict[str, Any]]:
    """Yield Table 1 in blocks of as many runs as fit side by side on paper."""
    for first in range(0, len(runs), BESIDE):
        some = runs[first : first + BESIDE]
        rows = [
            replace(row, estimates=tuple(None if x is None else prefixed(x) for x in row.estimates))
            for row in rows_and_needs([run.analysis for run in some])
        ]
        graded = grades_of(some[0].analysis) if len(runs) == 1 else {}
        shown = {row.name: graded[row.name] for row in rows if row.name in graded}
        sound = {graded.grade for graded in shown.values()} == {"sound"} and not is_about(some[0].analysis, "residuals")
        names = [run.name for run in some]
        yield {"names": names, "rows": rows, "grades": {} if sound else shown, "all_sound": sound}


def _part(index: int, run: Run, charts: Mapping[str, Chart], figures: Figures, stem: str) -> dict[str, Any]:
    """Return everything that the template needs about one run."""
    analysis, quality, given = run.analysis, run.result["quality"], run.result["input"]
    title = str(run.recorded.get("title") or given.get("title") or "")
    ordered = [*(name for name in _QUALITY if name in quality), *(name for name in quality if name not in _QUALITY)]
    return {
        "name": run.name,
        "index": index,
        "head": [
            _subtitle(title, given, analysis.track, quality),
            *filter(None, [date_words(run.recorded)]),
            f"Bench: {bench_words(analysis.scene)}.",
            *(f"Noted: {visible(str(note))}" for note in run.recorded.get("notes", ())),
        ],
        "kind": analysis.track.kind,
        "summary": summary(analysis),
        "method": method(analysis),
        "figures": {name: figures.add(chart, stem, index) for name, chart in charts.items()},
        "notices": notices_of(run.result["findings"], charts),
        "laws": laws_of(analysis),
        "budgets": budgets_of(analysis),
        "correlations": correlations_of(analysis),
        "effects": analysis.effects,
        "quality": [(_cause(name, analysis.track), quality[name]) for name in ordered],
        "notes": notes_of(run.recorded)[:MOST_NOTES],
        "more_notes": max(len(notes_of(run.recorded)) - MOST_NOTES, 0),
        "calibration": calibration_of(run.recorded),
        "classic": _classic_rows(run),
        "chi2": None if run.classic is None else run.classic.chi2,
        "input": list(_flattened(given)),
    }


def _subtitle(title: str, given: Mapping[str, Any], track: Track, quality: Mapping[str, int]) -> str:
    causes = [f"{count} {_cause(name, track)}" for name, count in quality.items() if count and name != "used"]
    left_out = f"{len(track) - quality['used']} left out{': ' if causes else ''}{', '.join(causes)}"
    duration_s = float(track.t[-1] - track.t[0])
    parts = [
        title,
        f"{len(track)} samples ({left_out}) at {track.rate_hz:g} Hz, {duration_s:.1f} s",
        f"format {given['format']}" if given.get("format") else None,
    ]
    return " · ".join(str(part) for part in parts if part) + "."


def _cause(name: str, track: Track) -> str:
    """Return in words why samples were left out; only distances have false echoes."""
    if track.unit != "m" and name in ("false_echo", "missing"):
        return "far from the motion" if name == "false_echo" else "without a value"
    return _QUALITY.get(name, name.replace("_", " "))


def _classic_rows(run: Run) -> list[tuple[str, Estimate | None, Estimate]] | None:
    """Return quantity, value of this analysis and value of the lab report's method."""
    if run.classic is None:
        return None
    words = {row.name: row.quantity for row in table_rows([run.analysis])}
    estimates = run.analysis.estimates
    return [(words.get(x, x.replace("_", " ")), estimates.get(x), value) for x, value in run.classic.estimates.items()]


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
