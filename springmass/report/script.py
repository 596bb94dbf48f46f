"""The script of a report: one inline classic script from sources that the page of a recording also uses."""

from __future__ import annotations

import base64
import functools
import hashlib

from springmass.layout import static_file

__all__ = ["SOURCES", "report_script", "report_style", "script_sha256"]

SOURCES = ("uPlot.iife.min.js", "charts.js", "explore.js", "report.js")
"""The sources, in this order; a page that is opened from a disk cannot import modules."""


@functools.cache
def report_script() -> str:
    """Return the script.

    Raises
    ------
    ValueError
        If a source would end the element that contains it.
    """
    script = "\n".join(static_file(name).read_text("utf-8") for name in SOURCES)
    if "</script" in script.lower() or "<!--" in script:
        raise ValueError("a script of a report must hold neither </script nor <!--")
    return f"\n{script}\n"


def report_style() -> str:
    """Return the style of the charts."""
    return static_file("uPlot.min.css").read_text("utf-8")


@functools.cache
def script_sha256() -> str:
    """Return the base64 digest of the script for ``'sha256-...'`` in a Content-Security-Policy."""
    return base64.b64encode(hashlib.sha256(report_script().encode()).digest()).decode()
