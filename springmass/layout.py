"""Where the parts of the program are: next to ``springmass`` in a checkout, inside it when installed from a wheel."""

from __future__ import annotations

from pathlib import Path

__all__ = ["PACKAGES", "PREFIX", "part"]

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
