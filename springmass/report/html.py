"""The page of a report: one file that holds its pictures and needs nothing from anywhere else."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from acquisition.errors import visible
from pipeline.analyse import Analysis, Oscillation
from pipeline.registry.effects import EFFECTS
from pipeline.registry.quantities import INPUTS
from pipeline.track import Track
from springmass.report.advice import ADVICE, sorted_out
from springmass.report.budgets import budgets_of, correlations_of
from springmass.report.figures.inline import inline_svg
from springmass.report.laws import laws_across, laws_of
from springmass.report.recorded import bench_words, calibration_of, date_words, notes_of
from springmass.report.tables import page_unit, pretty, pretty_number, table_rows
from springmass.report.words import caption, typeset, verdict
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
# What is wrong with each number of the report's own method; pipeline.results.classic derives it.
_BIASES = {
    "period": "two sampled maxima decide where a thousand samples could",
    "frequency": "as the period",
    "angular_frequency": "as the period",
    "spring_constant": "as the period, twice over; the spring's mass and the air carried along are left out",
    "amplitude": "extremes of noisy samples lie outside the motion, false echoes enter, clipping shortens",
    "damping_rate": "takes a lone exponential, tied to one point; overlapping windows count as independent",
    "velocity_rms": "differences of neighbouring distances carry noise, which adds to the mean square",
    "reynolds_number": "as the velocity; air taken at 20 °C without uncertainty",
}


BESIDE = 3  # columns of runs that a sheet of A4 holds
MOST_NOTES = 50  # of a recording that the page lists
_SECTIONS = (
    ("position", "Position"),
    ("amplitude", "Amplitude and damping law"),
    ("drag", "Drag coefficient"),
    ("energy", "Energy"),
    ("motion", "Velocity and acceleration"),
    ("phase", "Phase plot"),
    ("classic", "The lab report's own method"),
)
"""Figures in the order of their sections, with the sections' titles."""


def render_html(
    runs: Sequence[Analysed],
    pictures: Sequence[Mapping[str, bytes]],
    *,
    compared: Compared | None = None,
    overview: bytes = b"",
    provenance: Mapping[str, Any],
) -> str:
    """Return the report as one self-contained page.

    Parameters
    ----------
    runs : sequence of Analysed
    pictures : sequence of mapping of str to bytes
        SVG files by figure name, one mapping a run.
    compared : Compared, optional
    overview : bytes
        :func:`springmass.report.figures.comparison_figure` as SVG, where runs were compared.
    provenance : mapping
        Shown as it is, nested mappings flattened.

    Notes
    -----
    First what holds, Table 1, the main figure and what changes a number, then everything else; each fact once.
    Every text is escaped by the template engine; only the pictures, made here, go in as they are.
    """
    # One run alone shows its law at the top; where several are compared it is their constants.
    numbers = itertools.count(2 if compared is not None else 1)
    parts = [
        _part(i, run, drawn, numbers, alone=len(runs) == 1)
        for i, (run, drawn) in enumerate(zip(runs, pictures, strict=True))
    ]
    return template("report.html.j2").render(
        title=", ".join(run.name for run in runs),
        parts=parts,
        tables=list(_tables(runs)),
        compared=None if compared is None else _compared(compared, overview),
        contents=list(_contents(parts, compared)),
        provenance=list(_flattened(provenance)),
    )


@functools.cache
def template(name: str) -> Template:
    """Return a page's template; to compile that of a report takes as long as to draw a figure."""
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
    }
    return environment.get_template(name)


def _shown(value: object) -> object:
    """Make control characters visible in whatever text the template puts in, its own markup aside."""
    return visible(value) if type(value) is str else value


def _tables(runs: Sequence[Analysed]) -> Iterator[dict[str, Any]]:
    """Yield Table 1 in blocks of as many runs as stand beside each other on paper."""
    for first in range(0, len(runs), BESIDE):
        some = runs[first : first + BESIDE]
        yield {"names": [run.name for run in some], "rows": table_rows([run.analysis for run in some])}


def _contents(parts: Sequence[Mapping[str, Any]], compared: Compared | None) -> Iterator[tuple[str, str]]:
    """Yield (id, title) of every section that the table of contents names."""
    yield "holds", "What holds"
    yield "table-1", "Table 1"
    if compared is not None or parts[0]["main"]:
        yield "main-figure", "Main figure"
    yield "heed", "What changes a number"
    if compared is not None:
        yield "comparison", "Comparison"
    if len(parts) == 1:
        yield from parts[0]["sections"]
    else:
        yield from ((f"run{part['index']}", part["name"]) for part in parts)
    yield "provenance", "Provenance"


def _part(
    index: int, run: Analysed, pictures: Mapping[str, bytes], numbers: Iterator[int], *, alone: bool
) -> dict[str, Any]:
    """Everything that the template says of one run."""
    analysis, quality, given = run.analysis, run.result["quality"], run.result["input"]
    motion = analysis.motion
    ordered = [*(name for name in _QUALITY if name in quality), *(name for name in quality if name not in _QUALITY)]
    main = next((name for name in ("amplitude", "position") if alone and name in pictures), "")
    drawn = [name for name in (main, *(name for name, _ in _SECTIONS if name != main)) if name in pictures]
    findings = [picked(x, ("code", "severity", "message")) for x in analysis.findings]
    part = {
        "name": run.name,
        "index": index,
        "head": [
            _subtitle(given, analysis.track),
            f"{date_words(run.recorded)[:1].upper()}{date_words(run.recorded)[1:]}.",
            f"Bench: {bench_words(analysis.scene)}.",
            *(f"Noted: {visible(str(note))}" for note in run.recorded.get("notes", ())),
        ],
        "kind": analysis.track.kind,
        "verdict": verdict(analysis),
        "main": main,
        "figures": {
            name: {
                "svg": inline_svg(pictures[name], f"{name}{index}-"),
                "caption": caption(name, analysis),
                "number": next(numbers),
                "id": f"figure-{name}-{index}",
            }
            for name in drawn
        },
        "told": sorted_out(run.result.get("findings", findings), drawn),
        "laws": laws_of(motion.damping) if isinstance(motion, Oscillation) else None,
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
    """Return a row a result: its symbol, and its correlations to itself and those before it."""
    names, matrix = correlations_of(analysis)
    symbols = {row.name: row.page_symbol for row in table_rows([analysis])}
    return [
        (symbols[name], [f"{round(value, 2) + 0.0:.2f}".replace("-", "−") for value in row[: i + 1]])
        for i, (name, row) in enumerate(zip(names, matrix, strict=True))
    ]


def _sections(part: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield (id, title) of the sections of a run that have anything to show."""
    there = {
        "amplitude": part["laws"] is not None,
        "motion": part["laws"] is not None,
        "classic": part["classic"] is not None,
        "position": True,
    }
    for name, title in _SECTIONS:
        if there.get(name, name in part["figures"]):
            yield f"{name}-{part['index']}", title
    for name, title in (("budgets", "Uncertainty"), ("effects", "Effects")):
        if part[name]:
            yield f"{name}-{part['index']}", title
    yield f"samples-{part['index']}", "Samples and recording"


def _subtitle(given: Mapping[str, Any], track: Track) -> str:
    duration_s = float(track.t[-1] - track.t[0])
    parts = [
        given.get("title"),
        f"{len(track)} samples at {track.rate_hz:g} Hz, {duration_s:.1f} s",
        f"format {given['format']}" if given.get("format") else None,
    ]
    return " · ".join(str(part) for part in parts if part)


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
    """Everything that the template says of the comparison."""
    found = compared.comparison
    return {
        "found": found,
        "message": typeset(found.message),
        "told": [picked(x, ("code", "severity")) | {"advice": ADVICE[x.code]} for x in compared.findings],
        "rows": list(zip(found.names, found.each, found.pulls, strict=True)),
        "figure": inline_svg(overview, "comparison-"),
        "joint": [laws_across(joint) for joint in compared.joint],
    }


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
    """Set the index that follows a space below the line."""
    from markupsafe import Markup, escape

    letter, mark, index = symbol.partition(" ")
    return (
        Markup("<i>{}</i><sub>{}</sub>").format(letter, index)
        if mark
        else Markup("<i>") + escape(letter) + Markup("</i>")
    )


def _breakable(law: str) -> Markup:
    """Let the name of a law break behind a plus."""
    from markupsafe import Markup, escape

    return Markup("+<wbr>").join(escape(term) for term in law.split("+"))
