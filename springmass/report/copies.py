"""Table 1 for pasting: as text, and as cells separated by tabs."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.analyse import Analysis
from springmass.report.tables import cell, prefixed, pretty, table_rows

__all__ = ["table_cells", "table_text"]


def table_text(names: Sequence[str], analyses: Sequence[Analysis]) -> str:
    """Return Table 1 as aligned text.

    Parameters
    ----------
    names : sequence of str
    analyses : sequence of Analysis
    """
    lines = [["quantity", "symbol", *map(cell, names)]]
    for row in table_rows(analyses):
        values = (pretty(None if x is None else prefixed(x)) for x in row.estimates)
        lines.append([row.quantity, row.page_symbol.replace(" ", ""), *values])
    widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]))]
    return "".join("  ".join(x.ljust(w) for x, w in zip(line, widths, strict=True)).rstrip() + "\n" for line in lines)


def table_cells(names: Sequence[str], analyses: Sequence[Analysis]) -> str:
    """Return Table 1 as cells separated by tabs: value and standard uncertainty of every run, in SI units.

    Parameters
    ----------
    names : sequence of str
    analyses : sequence of Analysis
    """
    heads = [head for name in map(cell, names) for head in (name, f"u of {name}")]
    lines = [["quantity", "symbol", "unit", *heads]]
    for row in table_rows(analyses):
        unit = next(x.unit for x in row.estimates if x is not None)
        values = ["" if x is None else repr(float(y)) for x in row.estimates for y in ((x.value, x.u) if x else (0, 0))]
        lines.append([row.quantity, row.page_symbol.replace(" ", ""), unit, *values])
    return "".join("\t".join(line) + "\n" for line in lines)
