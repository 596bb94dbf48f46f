"""One module a command: `run(options) -> exit code`.

In: the parsed command line (arguments are declared in `springmass.terminal.arguments`). Out: lines on stdout, messages
on stderr, files, an exit code of `springmass.errors`. Free to change: what one command prints; a new command is a
module here and two lines in `springmass.terminal.arguments`. Heavy parts are imported inside the functions that need
them, so that `--help` answers at once.
"""

from __future__ import annotations

import argparse
from typing import Any

__all__ = ["completions"]


def completions(options: argparse.Namespace) -> dict[str, Any]:
    """Return what the command line says of an input beyond its name, as :func:`springmass.runs.loading.load` takes
    it."""
    names = ("velocity", "channel", "run", "rate_hz", "unit", "time", "time_unit", "unverified")
    return {name: getattr(options, name) for name in names if hasattr(options, name)}  # not all commands have all
