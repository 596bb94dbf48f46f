"""Determine the capabilities of a stream: terminal or pipe, characters, width."""

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
    """The style of text on a stream.

    Parameters
    ----------
    terminal : bool
        Whether the stream is a terminal, with colour and lines rewritten in place.
    unicode : bool
        Whether the stream is a terminal that can show ± and superscripts.
    si : bool
        Whether quantities are in SI units without prefixes.
    width : int
        Width in columns.
    """

    terminal: bool = False
    unicode: bool = False
    si: bool = True
    width: int = WIDEST


PLAIN = TerminalStyle()


def style_of(stream: TextIO, *, si: bool = False) -> TerminalStyle:
    """Return the style of a stream; a pipe, a file or a terminal without a movable cursor gets plain ASCII.

    Parameters
    ----------
    stream : text stream
    si : bool
        Whether the command line requests SI units without prefixes.
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
    """Return whether a stream is a terminal that can move its cursor."""
    try:
        return (
            stream is not None
            and stream.isatty()
            and os.environ.get("TERM", "dumb" if os.name != "nt" else "") != "dumb"
        )
    except (OSError, ValueError):
        return False
