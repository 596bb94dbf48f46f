"""Where the parts of the program are: next to ``springmass`` in a checkout, inside it when installed from a wheel."""

from __future__ import annotations

from pathlib import Path

__all__ = ["PACKAGES", "PREFIX", "STDIN", "part", "static_file"]

STDIN = "<stdin>"
"""The path that stands for standard input, ``-`` on the command line."""
PACKAGES = ("acquisition", "pipeline", "storage")

_HOME = Path(__file__).resolve().parent

PREFIX = "springmass." if (_HOME / PACKAGES[0]).is_dir() else ""
"""What stands before the name of each of the packages when it is imported."""


def part(name: str) -> Path:
    """Return the folder of one of the packages, or of the bundled recordings; whether it exists is not checked.

    Examples
    --------
    >>> part("storage").name
    'storage'
    """
    return (_HOME if PREFIX else _HOME.parent) / name


def static_file(name: str) -> Path:
    """Return a file that browsers get: a script, a style or a picture.

    Examples
    --------
    >>> static_file("charts.js").is_file()
    True
    """
    return _HOME / "page" / "static" / name
