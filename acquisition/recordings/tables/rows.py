"""Read all rows of a text, or of a sheet of a workbook, as columns of numbers."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest

import numpy as np

from acquisition.block import B1, F8
from acquisition.errors import FormatError
from acquisition.recordings.recording import FormatIssue
from acquisition.recordings.tables.numbers import (
    EMPTY_CELL,
    EXPONENT,
    I1,
    THOUSANDS,
    UNREAD_CELL,
    is_cut,
    read_cells,
    split_page,
)
from acquisition.recordings.tables.table import Column, Lines, Table
from acquisition.recordings.tables.text import Text, decode
from acquisition.recordings.tables.times import clock_times

_MOST_EMPTY = 4_000_000
"""Cells that rows may lack, in addition to one for every byte, before the table counts as damaged."""
_REMEDY = "export the numbers without thousands separators"


def read_rows(
    path: str, text: Text, first: int, stop: int, mark: str, clocks: Sequence[int] = (), words: Sequence[int] = ()
) -> Table:
    """Read the rows from line ``first`` to before line ``stop``, as columns without names; blank lines are no rows.

    The cells of columns ``clocks`` are times of day or durations; those of ``words`` are kept as text too.
    """
    first = min(first, stop)
    pieces: list[list[tuple[int, F8, I1, B1]]] = []  # for each column, each from a row on
    cells_of: dict[int, list[bytes]] = {at: [] for at in (*clocks, *words)}
    numbers = [np.empty(0, np.int64)]
    allowed_cells, count, number, last = int(text.starts[stop] - text.starts[first]) + _MOST_EMPTY, 0, first + 1, []
    for page in text.pages(first, stop):
        lines = split_page(page, mark)
        numbers.append(np.flatnonzero(list(map(bool, lines))) + number)
        number += len(lines)
        rows = list(filter(None, lines))
        if not rows:
            continue
        allowed_cells -= len(rows) * max(map(len, rows))
        if allowed_cells < 0:
            raise FormatError(path, "expected rows of like length, got a few much longer rows", "split the file")
        for at, cells in enumerate(zip_longest(*rows, fillvalue=b"")):
            if at == len(pieces):
                pieces.append([])
            pieces[at].append((count, *read_cells(cells)))
            if at in cells_of:
                cells_of[at] += [b""] * (count - len(cells_of[at])) + list(cells)
            for row in np.flatnonzero(pieces[at][-1][2] == UNREAD_CELL).tolist():
                if THOUSANDS.fullmatch(cells[row]):
                    shown = cells[row].decode("utf-8", "replace")
                    problem = f'expected plain numbers, got a thousands separator in "{shown}"'
                    raise FormatError(path, problem, _REMEDY)
        count, last = count + len(rows), rows[-1]
    columns: list[Column] = []
    commas: list[B1] = []
    for at, of_column in enumerate(pieces):
        size = of_column[-1][0] + of_column[-1][1].size
        values, decimals, comma = np.full(size, np.nan), np.full(size, EMPTY_CELL, np.int8), np.zeros(size, bool)
        for begin, of_page, forms, commas_of_page in of_column:
            span = slice(begin, begin + of_page.size)
            values[span], decimals[span], comma[span] = of_page, forms, commas_of_page
        of_column.clear()
        if at in clocks:
            values, decimals = clock_times(cells_of[at])
        as_text = np.array([decode(cell).strip('"') for cell in cells_of[at]]) if at in words else None
        columns.append(Column("", "", values, decimals, words=as_text))
        commas.append(comma)
    traps = _decimal_marks(path, columns, commas)
    ended = first >= stop or stop < len(text) or text.ended
    cut = False
    if count and not ended:
        own_values, own_decimals = columns[len(last) - 1].values, columns[len(last) - 1].forms
        if is_cut(own_values, own_decimals):
            own_values[-1], own_decimals[-1] = np.nan, UNREAD_CELL
        cut = any(column.values.size == count and column.forms[-1] == UNREAD_CELL for column in columns)
    begin_with_text = columns[0].of_size(count).forms == UNREAD_CELL if columns else np.zeros(0, bool)
    where = Lines(np.concatenate(numbers), begin_with_text, ended, cut, text.zeros)
    return Table(tuple(columns), lines=where, traps=traps)


def _decimal_marks(path: str, columns: Sequence[Column], commas: Sequence[B1]) -> tuple[FormatIssue, ...]:
    """Refuse ``1,234`` if its comma may separate thousands: as a decimal mark it gives an error of a factor 1000.

    A comma or point is a decimal mark if anywhere it is not followed by exactly three digits, or follows a zero or four
    digits, or if the whole numbers next to such cells are about as large. Return a remark if a comma was read as a
    decimal mark, which nothing confirms.
    """
    certain, doubtful = set(), []
    for column, comma in zip(columns, commas, strict=True):
        size, forms = np.abs(column.values), column.forms
        group = (forms == 3) & (size >= 1.0) & (size < 1000.0)
        numbers, places = forms >= 0, forms % EXPONENT > 0
        for mark, marked in ((",", numbers & comma), (".", numbers & ~comma & places)):
            if (marked & ~group).any():
                certain.add(mark)
            elif marked.any():
                shown = f"{column.values[int(marked.argmax())]:.3f}".replace(".", mark)
                doubtful.append((mark, shown, _may_be_thousands(size, marked, forms == 0)))
    doubtful = [each for each in doubtful if each[0] not in certain]
    for _, shown, thousands in doubtful:
        if certain or thousands:
            raise FormatError(path, f'"{shown}" may have a thousands separator or a decimal mark', _REMEDY)
    if not doubtful or any(mark == "." for mark, _, _ in doubtful):
        return ()
    message = f'the comma in "{doubtful[0][1]}" was read as a decimal comma, not as a thousands separator'
    return (FormatIssue("decimal_comma", message),)


def _may_be_thousands(size: F8, marked: B1, whole: B1) -> bool:
    """Return whether a mark may separate thousands: 1.000 next to 950 may be, 26.000 next to 27 is none."""
    if not whole.any() or size[whole].max() >= 1000.0:
        return False
    pairs = np.flatnonzero((marked[1:] & whole[:-1]) | (whole[1:] & marked[:-1]))
    low, high = np.minimum(size[pairs], size[pairs + 1]), np.maximum(size[pairs], size[pairs + 1])
    return not (pairs.size and (high <= 2.0 * low).all())
