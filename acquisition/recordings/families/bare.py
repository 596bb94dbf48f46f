"""Bare numbers: rows without any text.

The delimiter and the decimal mark are inferred from the rows. A first column that rises in even steps, or the only
column that rises, is read as the times; this is reported unless it is the first column. Row numbers (steps of 1) are
not times. The user must give the unit, the channel if there are several columns, and the rate if there are no times.
None of these is guessed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acquisition.errors import FormatError
from acquisition.recordings.families import motion_sensor
from acquisition.recordings.recording import Trap
from acquisition.recordings.tables.contents import Channel, Contents, Heading, Sheet
from acquisition.recordings.tables.roles import are_row_numbers, times_by_steps
from acquisition.recordings.tables.sheet import ColumnFormat
from acquisition.recordings.tables.text import guess_delimiter, head_lines, parse_number, split_cells, text_of

__all__ = ["FORMAT"]

_ROWS = 100


def _rows(lines: Sequence[str]) -> tuple[list[list[float]], str]:
    """Return the numbers of the first rows and their separator; no rows if a cell of line 1 is not a number."""
    some = [line for line in lines if line.strip(" \t\0\x1a")][:_ROWS]
    mark = guess_delimiter(some[0]) if some else ""
    if mark == "," and not any(line.count(",") > 1 or "." in line for line in some):
        mark = _comma(some)
    parsed = [[parse_number(cell) for cell in split_cells(line, mark)] for line in some]
    if not parsed or not parsed[0] or None in parsed[0]:
        return [], mark
    rows = [[x for x in row if x is not None] for row in parsed if None not in row]
    return [row for row in rows if len(row) == len(rows[0])], mark


def _comma(lines: Sequence[str]) -> str:
    """Return "," if the only comma in each line separates two whole numbers, or "" if it is a decimal mark."""
    behind = {len(line.partition(",")[2].strip()) for line in lines}
    # A column of decimal fractions usually has the same number of decimals; a few lines are not enough to decide.
    return "" if len(behind) == 1 and behind != {0} and len(lines) > 2 else ","


def _evidence(head: bytes) -> str:
    rows, mark = _rows(head_lines(head[:4096]))
    if not rows or motion_sensor.FORMAT.recognises(head):
        return ""
    between = {"\t": "tabs", ";": "semicolons", ",": "commas", "": "blanks"}[mark]
    count = len(rows[0])
    return f"line 1 is {count} number{'s' if count > 1 else ''}" + (f" between {between}" if count > 1 else "")


def _contents(path: str, data: bytes) -> Contents:
    text = text_of(path, data)
    head = text.head(_ROWS)
    rows, mark = _rows([line.text for line in head])
    if not rows:
        raise FormatError(path, "expected rows of numbers", "check the file", line=1)
    numbers = [np.array(column) for column in zip(*rows, strict=True)]
    names = tuple(f"column {column + 1}" for column in range(len(numbers)))
    sheet = Sheet(text, text.start, text.stop, 1, mark, names=names)
    counts = len(names) > 1 and are_row_numbers(numbers[0])
    # A single column besides row numbers contains measured values, even if it rises.
    time = times_by_steps([Heading("", "")] * len(names), numbers) if len(names) > 1 + counts else None
    channels = (
        Channel(name, "", sheet, "", column, time)
        for column, name in enumerate(names)
        if column != time and not (column == 0 and counts)
    )
    traps = [] if not time else [Trap("time_assumed", f'"{names[time]}" was read as the times, because only it rises')]
    return Contents(tuple(channels), traps=tuple(traps), zeros=text.zeros)


FORMAT = ColumnFormat("bare", "bare numbers: rows without headings; the unit must be given", _evidence, _contents)
