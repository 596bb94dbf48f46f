"""Locations of the program's parts: next to ``springmass`` in a checkout, inside it when installed from a wheel."""

from pathlib import Path

STDIN = "<stdin>"
"""The path that represents standard input, which is ``-`` on the command line."""
PACKAGES = ("acquisition", "failure", "pipeline", "storage")

_HOME = Path(__file__).resolve().parent

PREFIX = "springmass." if (_HOME / PACKAGES[0]).is_dir() else ""
"""The prefix of each package's name in an import."""


def part(name: str) -> Path:
    """Return the folder of one of the packages or of the bundled recordings, without checking that it exists."""
    return (_HOME if PREFIX else _HOME.parent) / name
