"""Format Table 1 for a terminal or a pipe."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Mapping, Sequence

from acquisition.errors import visible
from pipeline.analyse import Analysis
from pipeline.numerics.estimate import Estimate
from springmass.report.tables import TableKey, TableRow, table_rows
from springmass.terminal.quantities import concise, shown
from springmass.terminal.style import PLAIN, TerminalStyle

__all__ = ["text_table"]

NARROWEST = 24  # minimum width of the column for the names of quantities, which wrap


def text_table(
    names: Sequence[str], runs: Sequence[Analysis | Mapping[TableKey, Estimate]], style: TerminalStyle = PLAIN
) -> str:
    """Return Table 1 in aligned columns; runs that do not fit side by side follow in another block.

    Parameters
    ----------
    names : sequence of str
        Names of the runs, shortened if they are wider than their column.
    runs : sequence of Analysis or of mapping
        Analyses, or their estimates from :func:`springmass.report.tables.table_estimates`.
    style : TerminalStyle
        Style of the stream. A pipe gets ASCII; a terminal gets rules and ±. If the runs do not fit side by side, the
        uncertainty is given as digits in parentheses.

    Examples
    --------
    >>> import numpy as np
    >>> from pipeline.analyse import analyse
    >>> from pipeline.track import Track
    >>> t = np.arange(1000) / 100
    >>> y = 0.2 + 0.05 * np.cos(8.3 * t) + 1e-4 * np.random.default_rng(1).standard_normal(1000)
    >>> text_table(["bob"], [analyse(Track.from_arrays(t, y))]).splitlines()[2].split()[::4]
    ['period', '0.000022']
    """
    rows = table_rows(runs, missing=True)
    left = max([len("quantity"), *(len(row.quantity) for row in rows)]) + 2
    middle = max([len("symbol"), *(len(row.symbol) for row in rows)]) + 2
    for form in (shown, concise):
        cells = [tuple(form(x, style) for x in row.estimates) for row in rows]
        widest = max([8, *(len(cell) for row in cells for cell in row)])
        room = style.width - left - middle
        if len(names) == 1 and all(len(row.note) <= room for row in rows):
            widest = max([widest, *(len(row.note) for row in rows)])
        cells = [
            (_noted(row, widest),) * len(line) if row.note else line for row, line in zip(rows, cells, strict=True)
        ]
        together = max(1, (style.width - left - middle + 3) // (widest + 3))
        if together >= len(names):
            break
    else:
        # Long names of quantities wrap if all runs then fit side by side.
        wrapped = style.width - middle + 3 - len(names) * (widest + 3)
        if wrapped >= NARROWEST:
            left, together = wrapped, len(names)
    blocks = []
    for first in range(0, len(names), together):
        chosen = slice(first, first + together)
        heads = [_shortened(_readable(name, style), widest) for name in names[chosen]]
        part = [row[chosen] for row in cells]
        blocks.append(
            _drawn(rows, heads, part, style) if style.terminal else _plain(rows, heads, part, left, middle, widest)
        )
    return "\n\n".join(blocks) + "\n"


def _plain(
    rows: Sequence[TableRow], heads: Sequence[str], cells: Sequence[Sequence[str]], left: int, middle: int, widest: int
) -> str:
    lines = [_line("quantity", "symbol", heads, left, middle, widest)]
    lines.append("-" * max(len(lines[0]), left + middle + len(heads) * (widest + 3) - 3))
    for row, values in zip(rows, cells, strict=True):
        first, *others = textwrap.wrap(row.quantity, left - 2)
        lines += [_line(first, row.symbol, values, left, middle, widest), *(f"  {line}" for line in others)]
    return "\n".join(line.rstrip() for line in lines)


def _drawn(rows: Sequence[TableRow], heads: Sequence[str], cells: Sequence[Sequence[str]], style: TerminalStyle) -> str:
    """Return the table drawn by rich, in colour unless NO_COLOR is set."""
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(
        box=box.SIMPLE_HEAD if style.unicode else box.ASCII2, pad_edge=False, show_edge=False, header_style="bold"
    )
    table.add_column("quantity")  # on a narrow terminal, the name of the damping law wraps
    table.add_column("", style="dim", no_wrap=True)
    for head in heads:
        table.add_column(Text(head), no_wrap=True)
    for row, values in zip(rows, cells, strict=True):
        symbol = row.page_symbol.replace(" ", "") if style.unicode else row.symbol
        table.add_row(row.quantity, symbol, *(Text(value) for value in values))
    console = Console(file=io.StringIO(), force_terminal=True, width=style.width, highlight=False)
    console.print(table)
    assert isinstance(console.file, io.StringIO)
    return "\n".join(line.rstrip() for line in console.file.getvalue().splitlines())


def _line(quantity: str, symbol: str, cells: Sequence[str], left: int, middle: int, widest: int) -> str:
    return quantity.ljust(left) + symbol.ljust(middle) + "   ".join(cell.ljust(widest) for cell in cells)


def _noted(row: TableRow, width: int) -> str:
    """Return the reason why a row has no values, shortened if it does not fit the column."""
    return row.note if len(row.note) <= width else "no mass"


def _shortened(name: str, width: int) -> str:
    # Names of one experiment differ at the end as often as at the beginning, so both are kept.
    return name if len(name) <= width else f"{name[: width // 2 - 1]}..{name[len(name) - (width - width // 2 - 1) :]}"


def _readable(text: str, style: TerminalStyle) -> str:
    return visible(text) if style.unicode else visible(text).encode("ascii", "replace").decode()
