"""The script and style with which a browser draws charts, from ``static``; reports, courses and pages share them."""

from __future__ import annotations

import base64
import functools
import hashlib
from pathlib import Path

from springmass.charts.looks import looks_script

SCRIPTS = ("uPlot.iife.min.js", "charts.js", "report.js")
"""The sources of a report's script, in this order; a page that is opened from a disk cannot import modules."""
STYLES = ("uPlot.min.css", "charts.css")


@functools.cache
def report_script() -> str:
    """Return the script of reports; its sources may hold neither </script nor <!--, which would end its element."""
    return f"\n{looks_script()}{_texts(SCRIPTS)}\n"


@functools.cache
def script_sha256() -> str:
    """Return the base64 digest of the script for ``'sha256-...'`` in a Content-Security-Policy."""
    return base64.b64encode(hashlib.sha256(report_script().encode()).digest()).decode()


def chart_style() -> str:
    """Return the style of charts, which the page of a recording has too."""
    return _texts(STYLES)


def _texts(names: tuple[str, ...]) -> str:
    return "\n".join(Path(__file__).with_name("static").joinpath(name).read_text("utf-8") for name in names)
