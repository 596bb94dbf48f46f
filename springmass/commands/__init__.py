"""One module a command: `run(options) -> exit code`."""

from __future__ import annotations

import argparse
from typing import Any

__all__ = ["completions"]


def completions(options: argparse.Namespace) -> dict[str, Any]:
    """Return what the command line says of an input beyond its name, as :func:`springmass.runs.loading.load` takes
    it."""
    names = ("velocity", "channel", "run", "rate_hz", "unit")
    return {name: getattr(options, name) for name in names if hasattr(options, name)}  # not all commands have all
