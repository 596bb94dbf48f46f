"""The page of a report: one file that holds its pictures and needs nothing from anywhere else."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from acquisition.errors import visible
from pipeline.analyse import Analysis, Oscillation
from pipeline.damping.joint import JointDamping
from pipeline.damping.select import Damping
from pipeline.numerics.estimate import Joint
from pipeline.track import Track
from springmass.report.budgets import INPUTS, budgets_of
from springmass.report.tables import law_status, page_unit, pretty, pretty_number, table_rows
from springmass.report.words import LETTERS, caption, verdict
from springmass.runs.analysing import Analysed
from springmass.runs.comparing import Compared

if TYPE_CHECKING:
    from markupsafe import Markup

__all__ = ["inline_svg", "render_html"]

_SEVERITIES = {"error": "Error", "warning": "Warning", "info": "Note"}
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
    Every text is escaped by the template engine; only the pictures, made here, go in as they are.
    """
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, finalize=_shown
    )
    environment.filters |= {"pretty": pretty, "number": pretty_number, "symbol": _symbol, "input": INPUTS.__getitem__}
    source = files("springmass.report").joinpath("templates/report.html.j2").read_text(encoding="utf-8")
    parts = [_part(i, run, drawn) for i, (run, drawn) in enumerate(zip(runs, pictures, strict=True))]
    return environment.from_string(source).render(
        title=", ".join(run.name for run in runs),
        parts=parts,
        rows=table_rows([run.analysis for run in runs]),
        compared=None if compared is None else _compared(compared, overview),
        provenance=list(_flattened(provenance)),
    )


def _shown(value: object) -> object:
    """Make control characters visible in whatever text the template puts in, its own markup aside."""
    return visible(value) if type(value) is str else value


def _part(index: int, run: Analysed, pictures: Mapping[str, bytes]) -> dict[str, Any]:
    """Everything that the template says of one run."""
    analysis, quality, given = run.analysis, run.result["quality"], run.result["input"]
    motion = analysis.motion
    ordered = [*(name for name in _QUALITY if name in quality), *(name for name in quality if name not in _QUALITY)]
    return {
        "name": run.name,
        "subtitle": _subtitle(given, analysis.track),
        "kind": analysis.track.kind,
        "findings": _findings(analysis),
        "verdict": verdict(analysis),
        "figures": [
            {"name": name, "svg": inline_svg(svg, f"{name}{index}-"), "caption": caption(name, analysis)}
            for name, svg in pictures.items()
        ],
        "laws": _laws_of(motion.damping) if isinstance(motion, Oscillation) else None,
        "budgets": budgets_of(analysis),
        "effects": analysis.effects,
        "quality": [(_QUALITY.get(name, name.replace("_", " ")), quality[name]) for name in ordered],
        "classic": _classic_rows(run),
        "chi2": None if run.classic is None else run.classic.chi2,
        "input": list(_flattened(given)),
    }


def _subtitle(given: Mapping[str, Any], track: Track) -> str:
    duration_s = float(track.t[-1] - track.t[0])
    parts = [
        given.get("format"),
        given.get("title"),
        f"{len(track)} samples at {track.rate_hz:g} Hz, {duration_s:.1f} s",
    ]
    return " · ".join(str(part) for part in parts if part)


def _findings(analysis: Analysis) -> list[dict[str, str]]:
    """Errors first; among equals what became of the laws before what happened to samples."""
    severities = list(_SEVERITIES)
    ordered = sorted(analysis.findings, key=lambda x: (severities.index(x.severity), not x.code.startswith("law")))
    return [
        {"severity": x.severity, "word": _SEVERITIES[x.severity], "code": x.code, "message": x.message} for x in ordered
    ]


def _laws_of(damping: Damping) -> dict[str, Any]:
    fitted = {law: fit.joint for law, fit in damping.fits.items()}
    return _laws(damping, fitted, lambda law: law_status(damping, law))


def _laws_across(joint: JointDamping) -> dict[str, Any]:
    fitted = {law: fit.coefficients for law, fit in joint.fits.items()}
    return {"message": joint.message, **_laws(joint, fitted, lambda law: _joint_status(joint, law))}


def _laws(found: Damping | JointDamping, fitted: Mapping[str, Joint], status: Callable[[str], str]) -> dict[str, Any]:
    """Lay out every law tried: what was fitted, how well, and what became of it."""
    units = {name: unit for joint in fitted.values() for name, unit in zip(joint.names, joint.units, strict=True)}
    rows = [
        {
            "name": law,
            "cells": [replace(fitted[law][name], unit="") if name in fitted[law].names else None for name in units],
            "fit": fit,
            "bic": _difference(fit.bic - found.best.bic),
            "status": status(law),
            "look": "selected" if status(law) == "selected" else "rejected" if fit.rejected else "",
        }
        for law, fit in found.fits.items()
    ]
    heads = [LETTERS.get(name, name) + (f" / {page_unit(unit)}" if unit else "") for name, unit in units.items()]
    return {"heads": heads, "rows": rows}


def _difference(bic: float) -> str:
    return pretty_number(bic) if abs(bic) >= 1000.0 else f"{bic:.1f}".replace("-", "−")


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
        "rows": list(zip(found.names, found.each, found.pulls, strict=True)),
        "figure": inline_svg(overview, "comparison-"),
        "joint": [_laws_across(joint) for joint in compared.joint],
    }


def _joint_status(joint: JointDamping, law: str) -> str:
    rejection = joint.fits[law].rejection
    if rejection:
        return {"differ": "coefficients differ"}.get(rejection, rejection)
    if law == joint.selected:
        return "selected"
    return "admissible" if law in joint.admissible else "unlikely"


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


def inline_svg(svg: bytes, prefix: str) -> Markup:
    """Return an SVG file as an element for a page: names of its own, coordinates to a hundredth of a point.

    Parameters
    ----------
    svg : bytes
        As :func:`springmass.report.figures.render` makes it.
    prefix : str
        Of every id, so that figures on one page do not take each other's clip paths.
    """
    from markupsafe import Markup

    text = svg.decode()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r' xmlns(:xlink)?="[^"]*"| version="1.1"', "", text).replace("xlink:href", "href")
    used = dict.fromkeys(re.findall(r'(?:href="|url\()#([^")]+)', text))
    short = {name: f"{prefix}{i}" for i, name in enumerate(used)}

    def renamed(found: re.Match[str]) -> str:
        # Groups are named as well, but nobody calls them.
        return f' id="{short[found[1]]}"' if found[1] in short else ""

    text = re.sub(r' id="([^"]*)"', renamed, text)
    text = re.sub(r'(href="|url\()#([^")]+)', lambda found: f"{found[1]}#{short[found[2]]}", text)
    # A style for "*" would reach the whole page from here.
    text = re.sub(r"<style[^>]*>.*?</style>", "", text, flags=re.DOTALL)
    text = re.sub(r"<defs>\s*</defs>", "", text)
    text = re.sub(r"<[^>]+>", _rounded, text)
    text = _shared_styles(text)
    return Markup(re.sub(r">\s+<", "><", text).strip())


def _rounded(tag: re.Match[str]) -> str:
    # Text between tags, such as 0.0025 at an axis, is not touched, nor are pixels.
    if tag[0].startswith("<image"):
        return tag[0]
    shorter = re.sub(r"-?\d+\.\d{3,}", lambda number: f"{float(number[0]):.2f}".rstrip("0").rstrip("."), tag[0])
    return re.sub(r"\s+", " ", shorter)


def _shared_styles(text: str) -> str:
    """Move the style of a run of equal markers to one group around them."""
    one = r'<use href="[^"]*" x="[^"]*" y="[^"]*" style="[^"]*" ?/>'

    def grouped(found: re.Match[str]) -> str:
        styles = set(re.findall(r'style="([^"]*)"', found[0]))
        if len(styles) != 1:
            return found[0]
        return f'<g style="{styles.pop()}">' + re.sub(r' style="[^"]*"', "", found[0]) + "</g>"

    return re.sub(rf"{one}(?:\s*{one})+", grouped, text)
