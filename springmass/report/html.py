"""The page of a report: one file that holds its pictures and needs nothing from anywhere else."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from pipeline.analyse import Analysis, Motion
from pipeline.classic import Classic
from pipeline.compare import Comparison
from pipeline.cycles import NoOscillation
from pipeline.estimate import Estimate
from pipeline.relaxation import Relaxation
from springmass.report.figures import ZOOM_PERIODS, has_error_bars, is_long, turn_step
from springmass.report.tables import law_status, page_unit, pretty, pretty_number, table_rows

if TYPE_CHECKING:
    from markupsafe import Markup

__all__ = ["ReportRun", "inline_svg", "render_html"]

_SEVERITIES = {"error": "Error", "warning": "Warning", "info": "Note"}
_LETTERS = {"A0": "A₀", "gamma": "γ", "beta": "β", "mu": "μ"}
_QUALITY = {
    "used": "used",
    "missing": "without a distance",
    "false_echo": "false echoes",
    "clipped": "clipped",
    "duplicate_time": "at a time seen before",
    "non_monotonic_time": "running backward in time",
    "malformed_rows": "malformed rows",
}
# What is wrong with each number of the report's own method; pipeline.classic derives it.
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


@dataclass(frozen=True, slots=True, eq=False)
class ReportRun:
    """One run of a report.

    Parameters
    ----------
    name : str
    analysis : Analysis
    input : mapping
        What was read, to be shown as it is: path, format, sha256, kind, channel, samples, rate_hz,
        duration_s, and ``title``, the recording's own first line, if it has one.
    classic : Classic or None
        The report's own method on the same run, to be set beside.
    """

    name: str
    analysis: Analysis
    input: Mapping[str, Any]
    classic: Classic | None = None


def render_html(
    runs: Sequence[ReportRun],
    pictures: Sequence[Mapping[str, bytes]],
    *,
    comparison: Comparison | None = None,
    provenance: Mapping[str, Any],
    quality: Sequence[Mapping[str, int]] | None = None,
) -> str:
    """Return the report as one self-contained page.

    Parameters
    ----------
    runs : sequence of ReportRun
    pictures : sequence of mapping of str to bytes
        SVG files by figure name, one mapping a run.
    comparison : Comparison, optional
    provenance : mapping
        Shown as it is, nested mappings flattened.
    quality : sequence of mapping of str to int, optional
        Counts to show in place of ``Analysis.quality``, one mapping a run.

    Notes
    -----
    Every text is escaped by the template engine; only the pictures, made here, go in as they are.
    """
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"pretty": pretty, "number": pretty_number, "symbol": _symbol}
    source = files("springmass.report").joinpath("templates/report.html.j2").read_text(encoding="utf-8")
    counts = quality or [run.analysis.quality for run in runs]
    parts = [
        _part(i, run, drawn, counted)
        for i, (run, drawn, counted) in enumerate(zip(runs, pictures, counts, strict=True))
    ]
    return environment.from_string(source).render(
        title=", ".join(run.name for run in runs),
        parts=parts,
        rows=table_rows([run.analysis for run in runs]),
        comparison=comparison,
        compared=_compared(runs, comparison),
        provenance=list(_flattened(provenance)),
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


def _part(index: int, run: ReportRun, pictures: Mapping[str, bytes], quality: Mapping[str, int]) -> dict[str, Any]:
    """Everything that the template says of one run."""
    analysis = run.analysis
    motion = analysis.motion
    return {
        "name": run.name,
        "subtitle": _subtitle(run),
        "kind": analysis.track.kind,
        "findings": _findings(analysis),
        "verdict": _verdict(analysis),
        "figures": [
            {"name": name, "svg": inline_svg(svg, f"{name}{index}-"), "caption": _caption(name, analysis)}
            for name, svg in pictures.items()
        ],
        "laws": None if isinstance(motion, NoOscillation) else _laws(motion),
        "effects": analysis.effects,
        "quality": [(_QUALITY.get(name, name.replace("_", " ")), quality[name]) for name in _ordered(quality)],
        "classic": _classic_rows(run),
        "chi2": None if run.classic is None else run.classic.chi2,
        "input": list(_flattened(run.input)),
    }


def _ordered(quality: Mapping[str, int]) -> list[str]:
    return [name for name in _QUALITY if name in quality] + [name for name in quality if name not in _QUALITY]


def _subtitle(run: ReportRun) -> str:
    given, track = run.input, run.analysis.track
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


def _kept(estimate: Estimate) -> str:
    """Write an estimate so that no line breaks inside it."""
    return pretty(estimate).replace(" ", "\u00a0")


def _verdict(analysis: Analysis) -> str:
    if isinstance(analysis.motion, Relaxation):
        return f"{analysis.motion.why[0].upper()}{analysis.motion.why[1:]}."
    if isinstance(analysis.motion, NoOscillation):
        return "Nothing oscillates in this record; rest position and noise are all that it gives."
    damping = analysis.motion.damping
    chosen = damping.best.law.words
    if damping.best.rejected:
        return f"No damping law holds; the least bad is {chosen}, and its parameters must not be used."
    parameters = [
        f"{_LETTERS.get(name, name)}\u00a0=\u00a0{_kept(x)}"
        for name, x in damping.best.joint.estimates().items()
        if name != "A0"
    ]
    text = f"The amplitude is described by {chosen}" + (f": {', '.join(parameters)}." if parameters else ".")
    if damping.selected == "none":
        text = "The amplitude does not fall by more than this record can tell."
    rejected = [fit.law.words for fit in damping.fits.values() if fit.rejected]
    if rejected:
        text += f" Rejected: {'; '.join(rejected)}."
    others = [damping.fits[name].law.words for name in damping.admissible if name != damping.selected]
    if others:
        text += f" As good, as far as this record can tell: {'; '.join(others)}."
    return text


def _caption(name: str, analysis: Analysis) -> str:
    noise = analysis.estimates["noise"]
    sigma = _kept(Estimate(1e3 * noise.value, 1e3 * noise.u, "mm"))
    motion = analysis.motion
    if isinstance(motion, NoOscillation):
        return f"Distance from the sensor; nothing oscillates. Samples scatter by {sigma}."
    if name == "position":
        bars = "shown as error bars" if has_error_bars(analysis) else "too small for error bars to show"
        detail = f" Above the whole record, below its first {ZOOM_PERIODS} periods (shaded above)."
        return (
            "Distance from the sensor with the fitted motion; beneath, what the fit leaves, over the noise of "
            f"one sample, σ\u00a0=\u00a0{sigma}, {bars}.{detail if is_long(analysis) else ''}"
            " Flagged samples were left out of the fit and of the residuals."
        )
    if name == "amplitude":
        return (
            "Amplitude in windows of one period or a few, with one standard uncertainty u, and every law; "
            f"beneath, the residuals of the selected law, {motion.damping.selected}, over u."
        )
    if name == "phase":
        step = turn_step(motion)
        every = f" One turn in {step} is drawn." if step > 1 else ""
        return f"Velocity against displacement from rest; colour tells the time.{every}"
    mass = motion.derived.effective_mass_kg
    of = f"the mass that oscillates, {_kept(mass)}" if mass is not None else "one kilogram, as no mass was given"
    return (
        f"Energy of the oscillation, m ω² A²/2, for {of}; the band is one standard uncertainty u of a window, "
        "mass and frequency would shift all points alike."
    )


def _laws(motion: Motion) -> dict[str, Any]:
    damping = motion.damping
    units = {
        name: unit for fit in damping.fits.values() for name, unit in zip(fit.joint.names, fit.joint.units, strict=True)
    }
    rows = [
        {
            "name": law,
            "cells": [_bare(fit.joint[name]) if name in fit.joint.names else None for name in units],
            "fit": fit,
            "bic": _difference(fit.bic - damping.best.bic),
            "status": law_status(damping, law),
        }
        for law, fit in damping.fits.items()
    ]
    heads = [_LETTERS.get(name, name) + (f" / {page_unit(unit)}" if unit else "") for name, unit in units.items()]
    return {"heads": heads, "rows": rows}


def _bare(estimate: Estimate) -> Estimate:
    return Estimate(estimate.value, estimate.u)


def _difference(bic: float) -> str:
    return pretty_number(bic) if abs(bic) >= 1000.0 else f"{bic:.1f}".replace("-", "−")


def _classic_rows(run: ReportRun) -> list[dict[str, Any]] | None:
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


def _compared(runs: Sequence[ReportRun], comparison: Comparison | None) -> list[tuple[str, Estimate]]:
    """Pair the comparison's spring constants, in order, with the runs that have one."""
    if comparison is None:
        return []
    names = [run.name for run in runs if "spring_constant" in run.analysis.estimates]
    if len(names) != len(comparison.each):
        names = [f"run {i + 1}" for i in range(len(comparison.each))]
    return list(zip(names, comparison.each, strict=True))


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
