"""Read rows of numbers from the cells of a text, for all text formats.

Rows are read in pages of whole lines. :mod:`acquisition.recordings.tables.regular` reads a regular page as a whole;
the rows of other pages are read one by one. A number that lost digits is detected by its number of decimals, which
differs from the usual number in its column.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.block import B1, F8, I8
from acquisition.recordings.tables.regular import (
    EMPTY,
    EXPONENT,
    I1,
    UNREAD,
    RegularColumn,
    read_regular,
    read_single,
    unified,
)
from acquisition.recordings.tables.text import Text, parse_number

__all__ = ["EMPTY", "EXPONENT", "UNREAD", "Table", "read_table"]

_PAGE_BYTES = 1 << 16
_UNIFORM = 0.9  # minimum share of numbers with the usual decimals in a column that always prints that many
_SHORTER = 2
_LINE_END = re.compile(rb"\r\n?|\n")
_LF, _CR, _ZERO = (np.uint8(ord(c)) for c in "\n\r0")


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Columns of numbers.

    Parameters
    ----------
    values : tuple of (rows,) float64
        The wanted columns; NaN for a cell that is NaN, empty or unread.
    form : tuple of (rows,) int8
        The printed decimals of each cell, plus :data:`EXPONENT` if it has an exponent; negative if it is not a number:
        :data:`NAN`, :data:`EMPTY`, :data:`UNREAD`.
    unread : (rows,) bool
        Mask of rows that could not be read: too few or too many cells, a cell that is not a number, an incomplete
        number.
    text : (rows,) bool
        Mask of rows that begin with text.
    decimals : tuple of int
        Usual number of printed decimals in each column, or in its mantissas if its numbers have exponents.
    exponents : tuple of bool
        Whether a column usually prints exponents.
    last_cell : str
        The first cell of the last row, as printed.
    cut : bool
        Whether the last row is incomplete.
    first_line : int
    skipped : (lines,) int64
        For each line that is not a row, the number of rows before it.
    """

    values: tuple[F8, ...]
    form: tuple[I1, ...]
    unread: B1
    text: B1
    decimals: tuple[int, ...]
    exponents: tuple[bool, ...]
    last_cell: str
    cut: bool
    first_line: int
    skipped: I8

    def __len__(self) -> int:
        return int(self.unread.size)

    def line(self, row: int) -> int:
        """Return the one-based line number of a row in the file."""
        return self.first_line + int(row) + int(np.searchsorted(self.skipped, row, side="right"))


def read_table(
    text: Text,
    columns: Sequence[int],
    delimiter: str,
    *,
    width: int | None = None,
    start: int | None = None,
    stop: int | None = None,
    first_line: int = 1,
    shifts: Sequence[int] = (),
) -> Table:
    """Read columns of the rows of a text.

    Parameters
    ----------
    text : Text
    columns : sequence of int
        Indices of the columns to read, counted from 0.
    delimiter : str
        The separator of cells; empty for runs of white space.
    width : int, optional
        Number of cells in every row. By default rows may be ragged, and missing cells are empty.
    start, stop : int, optional
        Byte positions where the rows begin and end.
    first_line : int
        One-based number of the line at ``start``.
    shifts : sequence of int
        For each column, the exponent of the power of ten by which its numbers are multiplied.

    Returns
    -------
    Table
        Empty lines are not rows.

    Examples
    --------
    >>> read_table(Text.of(b"0.010\\t25.334\\n0.020\\t25.648\\n0.030\\t0."), (0, 1), "\\t", width=2).unread.tolist()
    [False, False, True]
    """
    start = text.start if start is None else start
    stop = text.stop if stop is None else stop
    data = text.data
    rows = _Rows(tuple(columns), delimiter, width, tuple(shifts) or (0,) * len(columns), _most(data, start, stop))
    for page in _pages(data, start, stop):
        rows.take(page)
    return rows.table(first_line, ended=start >= stop or data[stop - 1 : stop] in (b"\n", b"\r"))


def _most(data: bytes, start: int, stop: int) -> int:
    """Return an upper limit of the number of rows; memory for rows beyond the actual number is never touched."""
    raw = np.frombuffer(data, np.uint8)
    pages = (raw[at : min(at + _PAGE_BYTES, stop)] for at in range(start, stop, _PAGE_BYTES))
    # bytes.count() takes six times as long; the other characters between LF and CR in ASCII are rare.
    return 1 + sum(int(np.count_nonzero((page - _LF) <= _CR - _LF)) for page in pages)


def _pages(data: bytes, start: int, stop: int) -> Iterator[bytes]:
    """Yield pages of whole lines."""
    while start < stop:
        end = min(start + _PAGE_BYTES, stop)
        if end < stop:
            # A page ends after a LF, after a CR that is not part of CRLF, or at the end of its only line.
            whole = data.rfind(b"\n", start, end) + 1 or data.rfind(b"\r", start, end - 1) + 1
            if not whole:
                match = _LINE_END.search(data, end - 1, stop)
                whole = match.end() if match else stop
            end = whole
        yield data[start:end]
        start = end


class _Rows:
    """A collector of rows, page by page."""

    def __init__(
        self, columns: tuple[int, ...], delimiter: str, width: int | None, shifts: tuple[int, ...], max_rows: int
    ) -> None:
        self.columns, self.width, self.shifts = columns, width, shifts
        self.delimiter, self.mark = delimiter, delimiter or "\t"
        self.values = [np.empty(max_rows) for _ in columns]
        self.form = [np.empty(max_rows, np.int8) for _ in columns]
        self.unread = np.zeros(max_rows, bool)
        self.text = np.zeros(max_rows, bool)
        # For each form in a column, the count of numbers and whether any of them ends in a zero.
        self.counts = np.zeros((len(columns), 2 * EXPONENT), np.int64)
        self.padded = np.zeros((len(columns), 2 * EXPONENT), bool)
        self.rows = 0
        self.skipped: list[int] = []
        self.last: list[str] = []

    def take(self, lines: bytes) -> None:
        """Read the lines of a page."""
        lines = unified(lines, self.delimiter)
        columns = read_regular(lines, self.mark, self.columns, self.width, self.shifts)
        if columns is not None:
            self._add(columns, lines)
            return
        for line in lines.decode("ascii", "replace").split("\n")[:-1]:
            self._take_single(line)

    def _add(self, columns: list[RegularColumn], lines: bytes) -> None:
        """Append rows that are all valid, and keep the cells of the last row."""
        rows = slice(self.rows, self.rows + columns[0].values.size)
        raw = np.frombuffer(lines, np.uint8)
        for k, (values, form, last) in enumerate(columns):
            self.values[k][rows], self.form[k][rows] = values, form
            self.counts[k] += np.bincount(form[form >= 0], minlength=2 * EXPONENT)
            self.padded[k, form[(raw[last] == _ZERO) & (form >= 0)]] = True
        self.rows = rows.stop
        line = lines[lines.rfind(b"\n", 0, -1) + 1 : -1]
        self.last = [cell.strip(" ") for cell in line.decode("ascii", "replace").rstrip("\r").split(self.mark)]

    def _take_single(self, line: str) -> None:
        """Read one line."""
        if not line.strip(" \t"):
            self.skipped.append(self.rows)
            return
        cells = [_unquoted(cell) for cell in line.split(self.mark)]
        row, self.rows, self.last = self.rows, self.rows + 1, cells
        wanted = [cells[column] if column < len(cells) else "" for column in self.columns]
        forms = []
        for k, (cell, shift) in enumerate(zip(wanted, self.shifts, strict=True)):
            value, form = read_single(cell, shift)
            self.values[k][row], self.form[k][row] = value, form
            forms.append(form)
        self.text[row] = bool(cells[0]) and parse_number(cells[0]) is None
        if self.width is None:
            self.unread[row] = UNREAD in forms
        else:
            self.unread[row] = len(cells) < self.width or any(cells[self.width :]) or min(forms) <= EMPTY
        # In a ragged row a word in one column does not affect the numbers in the others.
        if self.width is None or not self.unread[row]:
            for k, (cell, form) in enumerate(zip(wanted, forms, strict=True)):
                if form >= 0:
                    self.counts[k, form] += 1
                    self.padded[k, form] |= cell.lower().partition("e")[0].endswith("0")

    def table(self, first_line: int, *, ended: bool) -> Table:
        """Return the collected rows, with incomplete numbers marked as unread."""
        values = [column[: self.rows] for column in self.values]
        form = [column[: self.rows] for column in self.form]
        unread, text = self.unread[: self.rows], self.text[: self.rows]
        usual, exponents = [], []
        for k, counts in enumerate(self.counts):
            exponents.append(bool(counts[EXPONENT:].sum() > counts[:EXPONENT].sum()))
            half = counts[EXPONENT:] if exponents[k] else counts[:EXPONENT]
            usual.append(_most_frequent(half) + EXPONENT * exponents[k])
            cut = self._cut(k, form[k], usual[k], exponents[k])
            if not ended and self.rows and self._is_cut_last(k, form[k], usual[k]):
                cut = np.zeros(self.rows, bool) if cut is None else cut
                cut[-1] = True
            if cut is not None:
                values[k][cut], form[k][cut] = np.nan, UNREAD
                unread |= cut
        if 0 in self.columns:
            text = form[self.columns.index(0)] == UNREAD
        return Table(
            tuple(values),
            tuple(form),
            unread,
            text,
            tuple(each % EXPONENT for each in usual),
            tuple(exponents),
            self.last[0] if self.last else "",
            cut=bool(self.rows) and not ended and bool(unread[-1]),
            first_line=first_line,
            skipped=np.array(self.skipped, np.int64),
        )

    def _always(self, k: int, usual: int, exponent: bool) -> bool:
        """Return whether a column always prints the same number of decimals."""
        counts = self.counts[k]
        numbers = int(counts[: 2 * EXPONENT if exponent else EXPONENT].sum())
        others = numbers - int(counts[usual])
        # If trailing zeros are not printed, no number ends in zero and several are shorter. A single one may be cut.
        padded = usual % EXPONENT and self.padded[k, usual]
        stripped = others >= _SHORTER and not padded
        return others <= (1 - _UNIFORM) * numbers and not stripped

    def _cut(self, k: int, form: I1, usual: int, exponent: bool) -> B1 | None:
        """Return the mask of numbers with too few or too many decimals; None if there are no such numbers."""
        if self.counts[k].sum() == self.counts[k][usual] or not self._always(k, usual, exponent):
            return None
        # If numbers usually have no exponent, a number with an exponent is also valid.
        differs: B1 = (form >= 0) & (form != usual) & (exponent | (form < EXPONENT))
        # A first value of 0 may be printed without decimals.
        differs[:1] &= (form[:1] != 0) | (self.values[k][:1] != 0)
        if exponent and differs.any():
            differs &= ~self._ends_alike(k, form, usual)
        return differs if differs.any() else None

    def _ends_alike(self, k: int, form: I1, usual: int) -> B1:
        """Return the mask of numbers in engineering notation, where mantissas of smaller numbers have fewer decimals.

        ``-1.00000E-03`` and ``-975.00E-06`` end at the same decimal place, and so do all numbers of the column.
        """
        size = np.abs(self.values[k][: self.rows])
        with np.errstate(divide="ignore"):
            exponent = 3.0 * np.floor((np.log10(size) - self.shifts[k]) / 3.0 + 1e-9)
        places = np.where((size > 0) & (form >= EXPONENT), form - EXPONENT - exponent, np.nan)
        usual_places = places[(form == usual) & np.isfinite(places)]
        if not usual_places.size or usual_places.min() != usual_places.max():
            return np.zeros(self.rows, bool)
        alike = places == usual_places[0]
        # A zero may have any number of decimals if the number of decimals varies in the column.
        return np.asarray(alike | ((size == 0) & (alike & (form != usual)).any()))

    def _is_cut_last(self, k: int, form: I1, usual: int) -> bool:
        """Return whether a last row without a line end may have been cut within its cell of a column.

        A number is complete if something follows it, or if it has all the decimals that its column always prints. In a
        column with varying or no decimals nothing shows that the last number is complete, so it counts as cut.
        """
        if len(self.last) > self.columns[k] + 1 or form[-1] < 0:
            return False
        if usual not in (0, EXPONENT) and self._always(k, usual, usual >= EXPONENT):
            return int(form[-1]) != usual
        return self.rows > 1


def _unquoted(cell: str) -> str:
    """Strip blanks and a pair of quotes from a cell."""
    cell = cell.strip(" ")
    return cell[1:-1].strip(" ") if len(cell) > 1 and cell[0] == cell[-1] == '"' else cell


def _most_frequent(counts: I8) -> int:
    """Return the most frequent form; of two equally frequent forms, the one with more decimals."""
    return int(counts.size - 1 - counts[::-1].argmax()) if counts.any() else 0
