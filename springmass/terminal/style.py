"""Determine the capabilities of a stream: terminal or pipe, characters, width."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TextIO

WIDEST = 100


@dataclass(frozen=True, slots=True)
class TerminalStyle:
    """The style of text on a stream: by default that of a pipe."""

    terminal: bool = False  # with lines rewritten in place
    unicode: bool = False  # can show ± and superscripts
    si: bool = True  # quantities in SI units without prefixes
    width: int = WIDEST


PLAIN = TerminalStyle()


def style_of(stream: TextIO, *, si: bool = False) -> TerminalStyle:
    """Return the style of a stream; a pipe, a file or a terminal without a movable cursor gets plain ASCII."""
    if not watched(stream):
        return TerminalStyle(si=si)
    from rich.console import Console

    options = Console(file=stream).options
    return TerminalStyle(True, not options.ascii_only, si, options.max_width)


def watched(stream: TextIO | None) -> bool:
    """Return whether a stream is a terminal that can move its cursor."""
    try:
        return (
            stream is not None and stream.isatty() and (os.name == "nt" or os.environ.get("TERM") not in (None, "dumb"))
        )
    except (OSError, ValueError):
        return False
