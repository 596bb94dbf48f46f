"""What a stream can show: a terminal or a pipe, its characters, its width."""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass
from typing import TextIO

__all__ = ["PLAIN", "TerminalStyle", "style_of"]

WIDEST = 100
PROBE = "±−·⁻⁰¹²³⁴⁵⁶⁷⁸⁹µ"


@dataclass(frozen=True, slots=True)
class TerminalStyle:
    """How text is shown on a stream.

    Parameters
    ----------
    terminal : bool
        Whether somebody watches: colour, lines rewritten in place.
    unicode : bool
        Whether it is a terminal that has ± and superscripts.
    si : bool
        Whether quantities stay in SI units without prefixes.
    width : int
        Columns.
    """

    terminal: bool = False
    unicode: bool = False
    si: bool = True
    width: int = WIDEST


PLAIN = TerminalStyle()


def style_of(stream: TextIO, *, si: bool = False) -> TerminalStyle:
    """Return what a stream can show; a pipe, a file and a terminal without a cursor get ASCII with the same numbers.

    Parameters
    ----------
    stream : text stream
    si : bool
        As asked for on the command line.
    """
    if not watched(stream):
        return TerminalStyle(si=si)
    columns = shutil.get_terminal_size((WIDEST, 24)).columns
    try:
        PROBE.encode(stream.encoding or "ascii")
    except (UnicodeError, LookupError):
        return TerminalStyle(terminal=True, si=si, width=columns)
    return TerminalStyle(True, True, si, columns)


def watched(stream: TextIO | None) -> bool:
    """Tell whether a stream is a terminal that can move its cursor."""
    try:
        return (
            stream is not None
            and stream.isatty()
            and os.environ.get("TERM", "dumb" if os.name != "nt" else "") != "dumb"
        )
    except (OSError, ValueError):
        return False
