"""Rows of numbers: the one reader of cells behind every text format.

Lines are taken a page at a time. Where all of a page are laid out alike, each column is one calculation over the page.
Where they are not, but hold numbers of the forms they held before, cells are walked to from the start of each line
(:mod:`acquisition.recordings.tables.walk`). Else the page's separators are found all at once; cells of the form that
a column
usually has become numbers together, column by column (:mod:`acquisition.recordings.tables.fixed_point`), then those
of other
forms, form by form; what is left is read singly. Each cell keeps its form, and by the forms a number that was cut is
known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.block import F8, I8
from acquisition.recordings.tables.cells import EMPTY, EXPONENT, UNREAD, read_column, read_single
from acquisition.recordings.tables.fixed_point import Page, is_fixed, read_alike, read_signed
from acquisition.recordings.tables.growing import Growing
from acquisition.recordings.tables.line_pages import NEWLINE, RETURN, Alike, Lines, alike_lines, first_cells, next_page
from acquisition.recordings.tables.text import Text
from acquisition.recordings.tables.walk import line_starts, walk

__all__ = ["Table", "read_table"]

I1 = NDArray[np.int8]

_PAGE_ROWS = 8_000  # their columns fit into the cache
_PAGE_BYTES = 1 << 15, 1 << 19
_KEPT_BYTES = 1 << 21
_UNIFORM = 0.9  # a column that prints the same number of decimals in this share of its rows always does
_MANY, _STRIPPED = 40, 0.03
_WORD = 8
_ZERO = ord("0")


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Columns of numbers.

    Parameters
    ----------
    values : tuple of (rows,) float64
        The columns asked for; NaN where a cell says so, is empty, or could not be read. A column of one number
        throughout is a view of that one, and read-only.
    form : tuple of (rows,) int8
        The decimals that each cell prints, plus :data:`EXPONENT` where it has an exponent; negative where it is no
        number: :data:`NAN`, :data:`EMPTY`, :data:`UNREAD`. Read-only where all cells have one form.
    bad : (rows,) bool
        Rows that could not be read: too few or too many cells, a cell that is no number, a number that was cut.
    decimals : tuple of int
        Decimals that each column usually prints, of its mantissas where its numbers have exponents.
    exponents : tuple of bool
        Whether a column usually prints exponents.
    last_cell : str
        The first cell of the last row, as printed.
    cut : bool
        Whether the last row stopped midway.
    first_line : int
    skipped : (lines,) int64
        Rows before each line that makes no row.
    """

    values: tuple[F8, ...]
    form: tuple[I1, ...]
    bad: NDArray[np.bool_]
    decimals: tuple[int, ...]
    exponents: tuple[bool, ...]
    last_cell: str
    cut: bool
    first_line: int
    skipped: I8

    def __len__(self) -> int:
        return int(self.bad.size)

    def line(self, row: int) -> int:
        """Return the one-based line of a row in the file."""
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
        Which columns, counted from 0.
    delimiter : str
        What separates cells; empty for runs of white space.
    width : int, optional
        Cells that a row must have. Left out, rows may be ragged: a cell that is not there is empty.
    start, stop : int, optional
        Bytes where the rows begin and end.
    first_line : int
        One-based line of the file at ``start``.
    shifts : sequence of int
        A power of ten for each column that its numbers are multiplied with.

    Returns
    -------
    Table
        Empty lines make no row.

    Examples
    --------
    >>> read_table(Text.of(b"0.010\\t25.334\\n0.020\\t25.648\\n0.030\\t0."), (0, 1), "\\t", width=2).bad.tolist()
    [False, False, True]
    """
    start = text.start if start is None else start
    stop = text.stop if stop is None else stop
    raw = np.frombuffer(text.data, np.uint8)[:stop]
    returns = text.data.find(b"\r", start, stop) >= 0
    rows = _Rows(tuple(columns), delimiter, width, tuple(shifts) or (0,) * len(columns), returns)
    # glibc hands back what is freed on top of its heap, unless a larger block was freed once; to fetch it anew, page
    # after page, costs more than to calculate in it.
    np.empty(_KEPT_BYTES, np.uint8)
    at, size = start, _PAGE_BYTES[0]
    while at < stop:
        end = next_page(raw, at, size, delimiter, rows.page)
        before = rows.rows
        rows.take((stop - at) / (end - at))
        long = (end - at) / max(rows.rows - before, 1)
        at, size = end, int(min(max(long * _PAGE_ROWS, _PAGE_BYTES[0]), _PAGE_BYTES[1]))
    return rows.table(first_line, ended=start >= stop or int(raw[-1]) in (NEWLINE, RETURN))


class _Rows:
    """Gathers the rows of one page after the other."""

    def __init__(
        self, columns: tuple[int, ...], delimiter: str, width: int | None, shifts: tuple[int, ...], returns: bool
    ) -> None:
        self.columns, self.width, self.shifts, self.returns = columns, width, shifts, returns
        self.mark = ord(delimiter or "\t")
        self.points = b"." if delimiter == "," else b".,"
        self.values = [Growing(np.float64) for _ in columns]
        self.form = [Growing(np.int8) for _ in columns]
        self.bad = Growing(np.bool_)
        self.usual = [-1] * len(columns)
        self.padded = [False] * len(columns)
        self.counts = np.zeros((len(columns), 256), np.int64)
        self.rows = 0
        self.skipped: list[I8] = []
        self.page = Page(np.zeros(1, np.uint8))
        self.last = b""
        self.last_cells = 0
        # Pages that are not walked, and how many will not be when one could not be walked.
        self.halt, self.halts = 0, 1

    def take(self, pages: float) -> None:
        """Read the rows on the page; ``pages`` like it are left, it included."""
        page = self.page
        alike = alike_lines(page, self.mark)
        if alike is not None and self._take_alike(alike, pages):
            return
        if self._take_walking(pages):
            return
        lines = Lines.of(page, self.mark)
        if lines is None:
            unified = page.raw.tobytes().replace(b"\r\n", b"\n").replace(b"\r", b"\n")
            page.fill(np.frombuffer(unified, np.uint8))
            self.take(pages)
            return
        blank = lines.blank(page.raw)
        if blank is not None:
            self.skipped.append(np.cumsum(~blank)[blank] + self.rows)
            lines = lines.keep(~blank)
        if lines.stop.size:
            self._take_lines(lines, pages)

    def _take_alike(self, lines: Alike, pages: float) -> bool:
        """Read lines laid out alike, if what is asked for of them are plain numbers; tell whether they are."""
        page, count = self.page, lines.rows
        if self.width not in (None, len(lines.cells)) or max(self.columns) >= len(lines.cells):
            return False
        cells = [lines.cells[column] for column in self.columns]
        found = [read_single(page, *cell, shift) for cell, shift in zip(cells, self.shifts, strict=True)]
        for (begin, end), (_, form) in zip(cells, found, strict=True):
            if not (0 <= form < EXPONENT and is_fixed(page.raw[begin:end].tobytes(), form)):
                return False
        expected = self._expected(count, pages)
        for k, (cell, (value, form)) in enumerate(zip(cells, found, strict=True)):
            if _is_constant(page, lines, cell):
                self.values[k].repeat(value, count, expected)
            else:
                room = self.values[k].room(count, expected)
                read_alike(page, count, lines.width, cell, (form, self.shifts[k]), room)
            self.form[k].repeat(form, count, expected)
            if self.usual[k] < 0:
                self.usual[k] = form
            if form and form == self.usual[k] and not self.padded[k]:
                self.padded[k] = bool((page.raw[cell[1] - 1 :: lines.width] == _ZERO).any())
            self.counts[k, form] += count
        self.bad.repeat(False, count, expected)
        begin, end = (at + (count - 1) * lines.width for at in lines.cells[0])
        self._end(count, page.raw[begin:end].tobytes(), len(lines.cells))
        return True

    def _take_walking(self, pages: float) -> bool:
        """Read lines whose first columns are asked for, if each cell has the form that its column had; tell whether."""
        page, count = self.page, len(self.columns)
        if self.halt or self.columns != tuple(range(count)) or self.width not in (None, count):
            self.halt = max(self.halt - 1, 0)
            return False
        first = first_cells(page, self.mark)
        if len(first) < count or (self.width is not None and len(first) > count):
            return False
        usual = self.usual.copy()
        for k, (begin, end) in enumerate(first[:count]):
            if usual[k] < 0:
                usual[k] = read_single(page, begin, end, 0)[1]
            if not (0 <= usual[k] < EXPONENT and is_fixed(page.raw[begin:end].tobytes(), usual[k])):
                return False
        start = line_starts(page, self.returns)
        if start is None or not self._walk(first[:count], start, usual, pages):
            self.halt, self.halts = self.halts, 2 * self.halts
            return False
        self.usual, self.halts = usual, 1
        return True

    def _walk(self, first: Sequence[tuple[int, int]], start: I8, forms: list[int], pages: float) -> bool:
        """Read the cells that a walk finds, or nothing; tell whether all have the forms of their columns."""
        page, count = self.page, start.size
        expected = self._expected(count, pages)
        for k, (cells, usual) in enumerate(zip(walk(page, first, start), forms, strict=True)):
            room = self.values[k].room(count, expected)
            if cells is None or read_signed(page, *cells, (usual, self.shifts[k]), self.points, room) is not None:
                for column in self.values[: k + 1]:
                    column.drop(count)
                return False
            if usual and not self.padded[k]:
                self.padded[k] = bool((page.raw.take(cells[0] - 1, mode="clip") == _ZERO).any())
        for k, usual in enumerate(forms):
            self.form[k].repeat(usual, count, expected)
            self.counts[k, usual] += count
        self.bad.repeat(False, count, expected)
        last = page.raw[int(start[-1]) : -1].tobytes().removesuffix(b"\r").split(bytes((self.mark,)))
        self._end(count, last[0], len(last))
        return True

    def _take_lines(self, lines: Lines, pages: float) -> None:
        """Read lines, however they are laid out."""
        page, count = self.page, lines.stop.size
        expected = self._expected(count, pages)
        bad = None if self.width is None else lines.not_of_width(page.raw, self.mark, self.width)
        odd = bad is not None and bool(bad.any())
        forms = [each.room(count, expected) for each in self.form]
        for k, column in enumerate(self.columns):
            values, form = self.values[k].room(count, expected), forms[k]
            self.usual[k], self.padded[k], plain = read_column(
                page, *lines.bounds(column), self.usual[k], self.shifts[k], self.points, values, form, self.padded[k]
            )
            if not plain:
                wrong = form == UNREAD if self.width is None else form <= EMPTY
                bad = wrong if bad is None else bad | wrong
                odd = True
        if bad is None:
            self.bad.repeat(False, count, expected)
        else:
            self.bad.room(count, expected)[:] = bad
        for k, form in enumerate(forms):
            if odd and bad is not None:
                self.counts[k] += np.bincount(form[~bad].view(np.uint8), minlength=256)
            else:
                self.counts[k, self.usual[k]] += count
        begin, end = lines.bounds(0)
        self._end(count, page.raw[int(begin[-1]) : int(end[-1])].tobytes(), int(lines.cells[-1]))

    def _expected(self, count: int, pages: float) -> int:
        """Return how many rows there will be, if so many pages come with as many rows each."""
        return self.rows + int(count * max(pages, 1.0) * 1.02) + 1

    def _end(self, count: int, cell: bytes, cells: int) -> None:
        """Note how a page of rows ended: the first cell of the last, and how many it has."""
        self.rows += count
        self.last, self.last_cells = cell, cells

    def table(self, first_line: int, *, ended: bool) -> Table:
        """Return the rows taken, with numbers that were cut marked."""
        values = [column.whole() for column in self.values]
        form = [column.whole() for column in self.form]
        bad = np.require(self.bad.whole(), requirements="W")
        counts = self.counts[:, :EXPONENT], self.counts[:, EXPONENT : 2 * EXPONENT]
        exponents = tuple(bool(e.sum() > f.sum()) for f, e in zip(*counts, strict=True))
        usual = tuple(
            _most_frequent(counts[int(exponent)][k]) + EXPONENT * int(exponent) for k, exponent in enumerate(exponents)
        )
        for k, each in enumerate(form):
            cut = self._cut(k, each, usual[k], exponents[k])
            if not ended and self.rows and self._is_cut_last(k, each, usual[k]):
                cut = np.arange(self.rows) == self.rows - 1 if cut is None else cut
                cut[-1] = True
            if cut is not None:
                values[k] = np.require(values[k], requirements="W")
                form[k] = np.require(each, requirements="W")
                values[k][cut], form[k][cut] = np.nan, UNREAD
                bad |= cut
        skipped = np.concatenate(self.skipped) if self.skipped else np.empty(0, np.int64)
        truncated = bool(self.rows) and not ended and bool(bad[-1])
        decimals = tuple(each % EXPONENT for each in usual)
        last = self.last.strip(b" ").decode("ascii", "replace")
        return Table(tuple(values), tuple(form), bad, decimals, exponents, last, truncated, first_line, skipped)

    def _fixed(self, k: int, usual: int, exponent: bool) -> bool:
        """Tell whether a column always prints the same number of decimals."""
        counts = self.counts[k]
        numbers = int(counts[: 2 * EXPONENT if exponent else EXPONENT].sum())
        others = numbers - int(counts[usual])
        # Where zeros at the end are not printed, a tenth of the numbers is shorter and none ends in zero.
        stripped = others >= _STRIPPED * numbers and numbers >= _MANY and not self.padded[k]
        return others <= (1 - _UNIFORM) * numbers and not stripped

    def _cut(self, k: int, form: I1, usual: int, exponent: bool) -> NDArray[np.bool_] | None:
        """Find numbers that lost some of their decimals, or grew others; None where there is none."""
        if self.counts[k][: 2 * EXPONENT].sum() == self.counts[k][usual] or not self._fixed(k, usual, exponent):
            return None
        # Where exponents are the exception, a number with one is as good as any.
        differs: NDArray[np.bool_] = (form >= 0) & (form != usual) & (exponent | (form < EXPONENT))
        return differs if differs.any() else None

    def _is_cut_last(self, k: int, form: I1, usual: int) -> bool:
        """Tell whether a last row without line end may have stopped within the cell of a column.

        A number is whole where something follows it, or where it has all the decimals that its column always
        prints. In a column that prints now more, now fewer, or none, nothing shows that the last number is whole,
        so it counts as cut.
        """
        if self.last_cells > self.columns[k] + 1 or form[-1] < 0:
            return False
        if usual not in (0, EXPONENT) and self._fixed(k, usual, usual >= EXPONENT):
            return int(form[-1]) != usual
        return self.rows > 1


def _most_frequent(counts: I8) -> int:
    """Return the form that occurs most often, the longer of two equally frequent."""
    return int(counts.size - 1 - counts[::-1].argmax()) if counts.any() else 0


def _is_constant(page: Page, lines: Alike, cell: tuple[int, int]) -> bool:
    """Tell whether a cell of at most eight characters is the same in all lines."""
    begin, end = cell
    if end - begin > _WORD:
        return False
    first = page.raw[begin:end]
    for row in (lines.rows - 1, lines.rows // 2):  # most columns are told by these
        if (page.raw[begin + row * lines.width : end + row * lines.width] != first).any():
            return False
    used = np.uint64((1 << 64) - (1 << 8 * (_WORD - end + begin)))
    differs = np.bitwise_xor(page.words[end :: lines.width][: lines.rows], page.words[end])
    return not np.bitwise_or.reduce(differs) & used
