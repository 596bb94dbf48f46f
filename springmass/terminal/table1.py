"""Format Table 1 for a terminal or a pipe."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from acquisition.errors import visible
from pipeline.analyse import Analysis
from springmass.runs.rows import table_rows
from springmass.terminal.style import PLAIN, TerminalStyle, concise, shown

NARROW, NARROWEST = 24, 12  # width of the column for the names of quantities, which wrap, for several runs and for one


def text_table(names: Sequence[str], runs: Sequence[Analysis], style: TerminalStyle = PLAIN) -> str:
    """Return Table 1 in aligned columns; runs that do not fit side by side follow in another block.

    Names that are wider than their column are shortened. If the runs do not fit side by side, the uncertainty is given
    as digits in parentheses.
    """
    rows = table_rows(runs, missing=True)
    symbols = [row.on_screen if style.unicode else row.symbol for row in rows]
    left = max([len("quantity"), *(len(row.quantity) for row in rows)])
    room = style.width - max([len("symbol"), *map(len, symbols)]) - 4
    for form in (shown, concise) if len(names) > 1 else (shown,):
        cells = [tuple(form(x, style) for x in row.estimates) for row in rows]
        widest = max([8, *(len(cell) for row in cells for cell in row)])
        if len(names) == 1:
            widest = max([widest, *(len(row.note) for row in rows if len(row.note) <= room - left)])
        if room + 3 - len(names) * (widest + 3) >= left:
            break
    # Otherwise the names of quantities wrap, and if that does not suffice, further blocks follow.
    together = min(len(names), max(1, (room + 3 - min(left, NARROW)) // (widest + 3)))
    left = min(left, max(NARROWEST, room + 3 - together * (widest + 3)))
    for i, row in enumerate(rows):
        if row.note:
            cells[i] = (row.note if len(row.note) <= widest else "no mass",) * len(names)
    heads = [shortened(readable(name, style), widest) for name in names]
    blocks = []
    for first in range(0, len(names), together):
        part = slice(first, first + together)
        lines = [("quantity", "symbol", *heads[part])]
        lines += [(row.quantity, symbol, *each[part]) for row, symbol, each in zip(rows, symbols, cells, strict=True)]
        blocks.append(aligned(lines, [left, 0, *[widest] * len(heads[part])], close=2))
    return "\n\n".join(blocks) + "\n"


def aligned(rows: Sequence[Sequence[str]], least: Sequence[int] = (), close: int = 0) -> str:
    """Return rows in columns, with a rule under the first; a first column wider than ``least[0]`` wraps.

    The first ``close`` columns are separated by two blanks, the others by three.
    """
    from rich.cells import cell_len, set_cell_size

    widths = [max(map(cell_len, column)) for column in zip(*rows, strict=True)]
    widths = [max(pair) for pair in zip(widths, least, strict=True)] if least else widths
    widths[0] = least[0] if least else widths[0]
    gaps = [2 if i < close else 3 for i in range(len(widths))]
    lines: list[str] = []
    for quantity, *others in rows:
        first, *more = textwrap.wrap(quantity, widths[0]) or [""]
        cells = [set_cell_size(text, w + gap) for text, w, gap in zip((first, *others), widths, gaps, strict=True)]
        lines += ["".join(cells).rstrip(), *(f"  {line}" for line in more)]
    return "\n".join([lines[0], "-" * (sum(widths) + sum(gaps[:-1])), *lines[1:]])


def shortened(name: str, width: int) -> str:
    """Return a name without its middle: those of one experiment differ at the end as often as at the beginning."""
    return name if len(name) <= width else f"{name[: width // 2 - 1]}..{name[len(name) - (width - width // 2 - 1) :]}"


def readable(text: str, style: TerminalStyle) -> str:
    """Return foreign text in the characters of a stream."""
    return visible(text) if style.unicode else visible(text).encode("ascii", "replace").decode()
