"""The files with which a browser draws charts, in ``static``: the page, reports and courses share them."""

from __future__ import annotations

from pathlib import Path

from springmass.charts.looks import looks_script

STATIC = Path(__file__).with_name("static")
REPORT_SCRIPTS = ("uPlot.iife.min.js", "charts.js", "report.js")
"""The sources of a report's script, in this order; a page that is opened from a disk cannot import modules."""
STYLES = ("uPlot.min.css", "charts.css")


def report_source() -> str:
    """Return the script of reports: the looks, and all sources after them."""
    return looks_script() + "\n".join(_text(name) for name in REPORT_SCRIPTS)


def chart_style() -> str:
    """Return the style of charts, which the page of a recording has too."""
    return "\n".join(_text(name) for name in STYLES)


def _text(name: str) -> str:
    return (STATIC / name).read_text("utf-8")
