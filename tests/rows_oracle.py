"""Rows of numbers read one by one in plain Python: what the reader of whole pages is held against.

It shares the grammar of numbers with nothing: a regular expression of its own, and ``float()``.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from dataclasses import dataclass

NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:[.,][0-9]*)?|[.,][0-9]+)(?:[eE][+-]?[0-9]{1,3})?")


@dataclass
class Rows:
    """Rows as they are: values (NaN where there is none), bad rows, lines, and the usual decimals of each column."""

    values: list[list[float]]
    bad: list[bool]
    line: list[int]
    decimals: list[int]


def cells_of(line: str, delimiter: str) -> list[str]:
    """Split a line; separators at its end make no cell."""
    if not delimiter:
        return line.split()
    cells = [cell.strip(" ") for cell in line.split(delimiter)]
    while cells and not cells[-1]:
        cells.pop()
    return [cell[1:-1].strip(" ") if len(cell) > 1 and cell[0] == cell[-1] == '"' else cell for cell in cells]


def number_of(cell: str, delimiter: str) -> tuple[float, int] | None:
    """Return a cell's value and its decimals: -1 where it is NaN or has an exponent; None where it is no number."""
    if cell.lower() in ("nan", "+nan", "-nan"):
        return math.nan, -1
    if not NUMBER.fullmatch(cell) or (delimiter == "," and "," in cell):
        return None
    plain = cell.replace(",", ".")
    value = float(plain)
    if math.isinf(value):
        return None
    mantissa, _, exponent = plain.lower().partition("e")
    return value, -1 if exponent else len(mantissa.partition(".")[2])


def read_rows(body: str, columns: int, delimiter: str, first_line: int = 1) -> Rows:
    """Read rows that must have so many cells."""
    rows = Rows([], [], [], [])
    printed: list[list[int]] = []
    for number, line in enumerate(body.split("\n"), first_line):
        if not line.strip(" \t"):
            continue
        cells = cells_of(line, delimiter)
        found = [number_of(cell, delimiter) for cell in cells]
        rows.bad.append(len(cells) != columns or None in found)
        rows.values.append([each[0] if each else math.nan for each in found[:columns]])
        rows.values[-1] += [math.nan] * (columns - len(rows.values[-1]))
        printed.append([each[1] if each else -1 for each in found[:columns]] + [-1] * (columns - len(found)))
        rows.line.append(number)
    for column in range(columns):
        counts = Counter(row[column] for row, bad in zip(printed, rows.bad, strict=True) if not bad)
        del counts[-1]
        most = max(counts.values(), default=0)
        rows.decimals.append(max((d for d, count in counts.items() if count == most), default=0))
    return rows
