"""What a stream can show: terminal or pipe, characters, width; and quantities in its characters."""

import os
from dataclasses import dataclass
from typing import TextIO

from pipeline.numerics.estimate import Estimate
from springmass.typeset import prefixed, pretty

WIDEST = 100


@dataclass(frozen=True, slots=True)
class TerminalStyle:
    """The style of text on a stream: by default that of a pipe."""

    terminal: bool = False  # with lines rewritten in place
    unicode: bool = False  # can show ± and superscripts
    si: bool = True  # quantities in SI units without prefixes
    width: int = WIDEST


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


def shown(estimate: Estimate | None, style: TerminalStyle, *, brackets: bool = False) -> str:
    """Return an estimate as text, with a prefix unless SI is wanted, and u after ± or as digits in parentheses."""
    if estimate is None:
        return "-"
    chosen = estimate if style.si else prefixed(estimate)
    if style.unicode:
        return pretty(chosen, brackets=brackets)
    return (repr(chosen) if brackets else str(chosen)).replace("µ", "u")


def concise(estimate: Estimate | None, style: TerminalStyle) -> str:
    """Return an estimate with its uncertainty as digits in parentheses, for many estimates side by side.

    >>> concise(Estimate(0.05145, 2e-5, "m"), TerminalStyle(True, True, si=False))
    '51.450(20) mm'
    """
    return shown(estimate, style, brackets=True)
