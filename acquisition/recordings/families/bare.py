"""Bare numbers: rows without a word on what they are.

Delimiter and decimal mark are told from the rows. A first column that runs forward in even steps is taken for times in
seconds, which is said; row numbers (steps of 1) are no times. The unit of distance must be given, with several columns
the channel, without times the rate: none of them is guessed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acquisition.errors import FormatError
from acquisition.recordings.families import motion_sensor
from acquisition.recordings.tables.contents import Channel, Contents, Sheet
from acquisition.recordings.tables.sheet import ColumnFormat
from acquisition.recordings.tables.text import guess_delimiter, head_lines, parse_number, split_cells, text_of

__all__ = ["FORMAT"]

_ROWS = 100


def _rows(lines: Sequence[str]) -> tuple[list[list[float]], str]:
    """Return the numbers of the first rows, and what separates them; none where line 1 is not all numbers."""
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
    """Tell whether the one comma of each line separates two whole numbers or is a decimal mark."""
    behind = {len(line.partition(",")[2].strip()) for line in lines}
    # One column of decimal fractions prints the same number of decimals; that alone does not settle it.
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
    sheet = Sheet(text, text.start, text.stop, 1, mark)
    width = len(rows[0])
    time = 0 if width > 1 and _are_times(np.array([row[0] for row in rows])) else None
    first = 1 if width > 1 and (time == 0 or _are_row_numbers(np.array([row[0] for row in rows]))) else 0
    channels = (Channel(f"column {column + 1}", "", sheet, "", column, time) for column in range(first, width))
    return Contents(tuple(channels), zeros=text.zeros)


def _are_row_numbers(first: np.ndarray) -> bool:
    return bool(first.size > 1 and first[0] in (0.0, 1.0) and (np.diff(first) == 1.0).all())


def _are_times(first: np.ndarray) -> bool:
    """Tell a column that runs forward, mostly in steps alike; whole numbers one by one are row numbers."""
    if first.size < 3 or not np.isfinite(first).all() or _are_row_numbers(first):
        return False
    steps = np.diff(first)
    usual = float(np.median(steps))
    return bool(usual > 0 and np.mean(np.abs(steps - usual) <= 0.5 * usual) >= 0.8)


FORMAT = ColumnFormat("bare", "bare numbers: nothing but rows; units are asked for", _evidence, _contents)
