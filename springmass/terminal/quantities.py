"""Format quantities for readers: a prefix that leaves few zeros, with ± or digits in parentheses."""

from __future__ import annotations

from pipeline.numerics.estimate import Estimate, UpperLimit, format_value, in_brackets
from springmass.terminal.style import TerminalStyle
from springmass.typeset import page_unit, prefixed, pretty, typeset


def shown(estimate: Estimate | None, style: TerminalStyle) -> str:
    """Return an estimate as text: plain SI for a pipe, with prefix and ± if the terminal supports it."""
    if estimate is None:
        return "-"
    chosen = estimate if style.si else prefixed(estimate)
    if style.unicode:
        return pretty(chosen)
    if isinstance(chosen, UpperLimit):
        return str(chosen).replace("µ", "u")
    return format_value(chosen.value, chosen.u, chosen.unit.replace("µ", "u"))


def concise(estimate: Estimate | None, style: TerminalStyle) -> str:
    """Return an estimate with its uncertainty as digits in parentheses, for many estimates side by side.

    >>> concise(Estimate(0.05145, 2e-5, "m"), TerminalStyle(True, True, si=False))
    '51.450(20) mm'
    """
    if estimate is None or isinstance(estimate, UpperLimit):
        return shown(estimate, style)
    chosen = estimate if style.si else prefixed(estimate)
    written = in_brackets(chosen.value, chosen.u)
    if not style.unicode:
        return f"{written} {chosen.unit.replace('µ', 'u')}".rstrip()
    return f"{typeset(written)} {page_unit(chosen.unit)}".rstrip()
