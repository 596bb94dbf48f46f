"""The script of reports and courses: inline, or one file for all reports of a course."""

from __future__ import annotations

import base64
import functools
import hashlib

from springmass.layout import static_file

SHARED = "charts.js"
"""The name of the script's own file."""
SOURCES = ("uPlot.iife.min.js", "charts.js", "report.js")
"""The sources, in this order; a page that is opened from a disk cannot import modules."""


@functools.cache
def report_script() -> str:
    """Return the script; ValueError if a source would end the element that contains it."""
    script = "\n".join(static_file(name).read_text("utf-8") for name in SOURCES)
    if "</script" in script.lower() or "<!--" in script:
        raise ValueError("a script of a report must hold neither </script nor <!--")
    return f"\n{script}\n"


@functools.cache
def report_style() -> str:
    """Return the style of the charts, which the page of a recording has too."""
    return "\n".join(static_file(name).read_text("utf-8") for name in ("uPlot.min.css", "charts.css"))


@functools.cache
def script_sha256() -> str:
    """Return the base64 digest of the script for ``'sha256-...'`` in a Content-Security-Policy."""
    return base64.b64encode(hashlib.sha256(report_script().encode()).digest()).decode()
