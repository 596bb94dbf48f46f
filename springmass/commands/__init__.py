"""One module a command: `run(options) -> exit code`.

In: the parsed command line (arguments are declared in `springmass.terminal.arguments`). Out: lines on stdout, messages
on stderr, files, an exit code of `springmass.errors`. Free to change: what one command prints; a new command is a
module here and two lines in `springmass.terminal.arguments`. Heavy parts are imported inside the functions that need
them, so that `--help` answers at once.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from acquisition.errors import NeedsAnswer
    from springmass.runs.loading import Loaded

__all__ = ["completions", "load_for", "worded_for"]


def completions(options: argparse.Namespace) -> dict[str, Any]:
    """Return what the command line says of an input beyond its name, as :func:`springmass.runs.loading.load` takes
    it."""
    names = ("velocity", "channel", "run", "rate_hz", "unit", "time", "time_unit", "unverified")
    return {name: getattr(options, name) for name in names if hasattr(options, name)}  # not all commands have all


def load_for(options: argparse.Namespace, path: str | Path, **how: Any) -> Loaded:
    """Load an input of a command; what it leaves open is asked as options of that command.

    Parameters
    ----------
    options : Namespace
    path : path
    **how
        What :func:`springmass.runs.loading.load` takes, on top of the completions of the command line or in their
        place.

    Raises
    ------
    acquisition.errors.FormatError, storage.errors.StorageError, springmass.errors.ProgramError
        As :func:`springmass.runs.loading.load`.
    """
    from acquisition.errors import NeedsAnswer
    from springmass.runs.loading import load

    try:
        return load(path, **{**completions(options), **how})
    except NeedsAnswer as asked:
        raise worded_for(options, asked) from None


def worded_for(options: argparse.Namespace, asked: NeedsAnswer, words: Sequence[str] | None = None) -> NeedsAnswer:
    """Return a question with the command line that answers it.

    Parameters
    ----------
    options : Namespace
    asked : NeedsAnswer
    words : sequence of str, optional
        The command line without what says how to read a recording; left out, as it was typed.
    """
    from springmass.runs.questions import for_command
    from springmass.terminal.arguments import without_completions

    given = completions(options)
    given.pop("velocity", None)  # one of the words
    words = ["springmass", *without_completions(options.words)] if words is None else words
    return asked.with_remedy(for_command(asked.question, words, given))
