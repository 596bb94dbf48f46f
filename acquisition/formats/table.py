"""Rows of numbers: the one reader of cells behind every text format.

Lines are taken a page at a time. A page's separators are found all at once; cells of the form that a column usually
has become numbers together, column by column (:mod:`acquisition.formats.fixed_point`), then those of other forms,
form by form; what is left is read singly. Each cell keeps its form, and by the forms a number that was cut is known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.block import F8, I8
from acquisition.formats.cells import EMPTY, EXPONENT, UNREAD, read_column
from acquisition.formats.fixed_point import Page, Span
from acquisition.formats.text import Text

__all__ = ["Table", "read_table"]

I1 = NDArray[np.int8]

_NEWLINE, _RETURN, _TAB, _BLANK = (ord(c) for c in "\n\r\t ")
_PAGE_ROWS = 12_000  # their columns fit into the cache
_PAGE_BYTES = 1 << 15, 1 << 19
_UNIFORM = 0.9  # a column that prints the same number of decimals in this share of its rows always does
_MANY, _STRIPPED = 40, 0.03


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Columns of numbers.

    Parameters
    ----------
    values : tuple of (rows,) float64
        The columns asked for; NaN where a cell says so, is empty, or could not be read.
    form : tuple of (rows,) int8
        The decimals that each cell prints, plus :data:`EXPONENT` where it has an exponent; negative where it is no
        number: :data:`NAN`, :data:`EMPTY`, :data:`UNREAD`.
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
    raw = np.frombuffer(text.data, np.uint8)[start:stop]
    rows = _Rows(tuple(columns), delimiter, width, tuple(shifts) or (0,) * len(columns))
    at, size = 0, _PAGE_BYTES[0]
    while at < raw.size:
        page, end = _page(raw, at, size, delimiter)
        before = rows.rows
        rows.take(page, (raw.size - at) / (end - at))
        long = (end - at) / max(rows.rows - before, 1)
        at, size = end, int(min(max(long * _PAGE_ROWS, _PAGE_BYTES[0]), _PAGE_BYTES[1]))
    return rows.table(first_line, ended=not raw.size or int(raw[-1]) in (_NEWLINE, _RETURN))


def _page(raw: NDArray[np.uint8], at: int, size: int, delimiter: str) -> tuple[NDArray[np.uint8], int]:
    """Return about so many bytes of whole lines, ended by LF, and where they end."""
    end = min(at + size, raw.size)
    if end < raw.size:
        end = _line_end(raw, at, end)
    page = raw[at:end]
    if page[-1] != _NEWLINE:
        page = np.append(page, np.uint8(_NEWLINE))
    return page if delimiter else _tabbed(page), end


def _line_end(raw: NDArray[np.uint8], at: int, end: int) -> int:
    """Return the end of the last line that ends before ``end``, or of the first line if it ends later."""
    for begin in (max(end - 1024, at), at):
        found = np.flatnonzero(raw[begin:end] == _NEWLINE)
        if found.size:
            return begin + int(found[-1]) + 1
    size = end - at
    for step in range(at, raw.size, size):
        piece = raw[step : step + size]
        found = np.flatnonzero((piece == _NEWLINE) | (piece == _RETURN))
        if found.size:
            # A CR alone ends a line; of CRLF both do.
            last = step + int(found[-1] if step == at else found[0])
            pair = raw[last] == _RETURN and last + 1 < raw.size and raw[last + 1] == _NEWLINE
            return last + 2 if pair else last + 1
    return int(raw.size)


def _tabbed(page: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Put one tab in place of every run of white space, and none at the ends of a line."""
    blank = (page == _BLANK) | (page == _TAB)
    ends = (page == _NEWLINE) | (page == _RETURN)
    after = np.concatenate(([True], (blank | ends)[:-1]))  # behind another blank, or at a line's begin
    before_end = np.zeros(page.size, bool)
    # A run that a line ends in: walk back from the end through single blanks left.
    keep = ~(blank & after)
    kept = page[keep]
    blank_kept = blank[keep]
    before_end[: kept.size - 1] = blank_kept[:-1] & ends[keep][1:]
    return np.where(blank_kept, np.uint8(_TAB), kept)[~before_end[: kept.size]]


@dataclass(frozen=True, slots=True, eq=False)
class _Lines:
    """Where the lines of a page and their cells are.

    Parameters
    ----------
    start, stop : (n,) int64
    ends : (m,) int64
        Every separator and line end.
    first : (n,) int64
        Of those, the first of each line.
    cells : (n,) int64
    regular : int
        Cells of every line, where all have as many; else 0.
    width : int
        Bytes of every line, where all are laid out alike; else 0.
    """

    start: I8
    stop: I8
    ends: I8
    first: I8
    cells: I8
    regular: int
    width: int = 0

    @classmethod
    def of(cls, page: Page, mark: int, *, alike: bool = True) -> _Lines | None:
        """Find the lines; None where a CR stands alone."""
        raw, newline, marks, returns = page.raw, page.where(_NEWLINE, 0), page.where(mark, 1), page.where(_RETURN, 2)
        if alike and (found := cls._alike(newline, marks, returns)) is not None:
            return found
        ends = np.flatnonzero(newline | marks)
        count = int(np.count_nonzero(newline))
        regular = ends.size // count
        if regular * count == ends.size and newline[ends[regular - 1 :: regular]].all():
            stop = ends[regular - 1 :: regular]
            first, cells = np.arange(0, ends.size, regular), np.broadcast_to(np.int64(regular), count)
        else:
            regular, last = 0, np.flatnonzero(newline[ends])
            stop, cells = ends[last], np.diff(last, prepend=-1)
            first = last - cells + 1
        start = np.empty_like(stop)
        start[0] = 0
        np.add(stop[:-1], 1, out=start[1:])
        if lone := int(np.count_nonzero(returns)):
            paired = raw.take(stop - 1, mode="clip") == _RETURN
            if np.count_nonzero(paired & (stop > start)) != lone:
                return None
            stop = stop - paired
        return cls(start, stop, ends, first, cells, regular)

    @classmethod
    def _alike(cls, newline: NDArray[np.bool_], marks: NDArray[np.bool_], returns: NDArray[np.bool_]) -> _Lines | None:
        """Take lines of one length with their separators in the same places, as fixed point gives; None for others."""
        width = int(newline.argmax()) + 1
        count = newline.size // width
        if count * width != newline.size or not newline[width - 1 :: width].all() or np.count_nonzero(newline) != count:
            return None
        places = np.flatnonzero(marks[:width])
        if np.count_nonzero(marks) != places.size * count or not all(marks[at::width].all() for at in places.tolist()):
            return None
        paired = bool(width > 1 and returns[width - 2 :: width].all())
        if np.count_nonzero(returns) != count * paired:
            return None
        start = np.arange(0, newline.size, width)
        ends = np.append(places, width - 1)
        cells = np.broadcast_to(np.int64(ends.size), count)
        return cls(start, start + (width - 1 - paired), ends, start, cells, ends.size, width)

    def span(self, page: Page, column: int) -> Span:
        """Return where the cells of a column are."""
        if self.width and column < self.regular:
            first = int(self.ends[column - 1]) + 1 if column else 0
            last = int(self.stop[0]) if column == self.regular - 1 else int(self.ends[column])
            return Span(page, self.stop.size, self.width, first, last)
        return Span(page, self.stop.size, given=self.bounds(column))

    def keep(self, rows: NDArray[np.bool_]) -> _Lines:
        """Return some of the lines."""
        return _Lines(self.start[rows], self.stop[rows], self.ends, self.first[rows], self.cells[rows], 0)

    def bounds(self, column: int) -> tuple[I8, I8]:
        """Return where the cells of a column begin and end; a cell that is not there is empty."""
        if column < self.regular:
            begin = self.start if column == 0 else self.ends[column - 1 :: self.regular] + 1
            return begin, self.stop if column == self.regular - 1 else self.ends[column :: self.regular].copy()
        at = self.first + column
        begin = self.start if column == 0 else self.ends.take(at - 1, mode="clip") + 1
        end = np.minimum(self.ends.take(at, mode="clip"), self.stop)
        absent = self.cells <= column
        return np.where(absent, self.stop, begin), np.where(absent, self.stop, end)


def _blank(raw: NDArray[np.uint8], lines: _Lines) -> NDArray[np.bool_] | None:
    """Tell lines that hold nothing but white space; None where there is none."""
    blank: NDArray[np.bool_] = lines.stop <= lines.start
    white = np.flatnonzero((raw.take(lines.start, mode="clip") <= _BLANK) & ~blank)
    if white.size:
        seen = np.cumsum((raw != _BLANK) & (raw != _TAB))
        before = np.where(lines.start[white] > 0, seen[lines.start[white] - 1], 0)
        blank[white] = seen[lines.stop[white] - 1] == before
    return blank if blank.any() else None


class _Rows:
    """Gathers the rows of one page after the other."""

    def __init__(self, columns: tuple[int, ...], delimiter: str, width: int | None, shifts: tuple[int, ...]) -> None:
        self.columns, self.width, self.shifts = columns, width, shifts
        self.mark = ord(delimiter or "\t")
        self.points = b"." if delimiter == "," else b".,"
        self.values = [np.empty(0) for _ in columns]
        self.form = [np.empty(0, np.int8) for _ in columns]
        self.bad = np.empty(0, bool)
        self.usual = [-1] * len(columns)
        self.padded = [False] * len(columns)
        self.counts = np.zeros((len(columns), 256), np.int64)
        self.rows = 0
        self.skipped: list[I8] = []
        self.page = Page(np.zeros(1, np.uint8))
        self.last = b""
        self.last_cells = 0

    def _make_room(self, more: int, pages: float) -> None:
        """Grow the columns, to the size that so many pages with so many rows each will need."""
        if self.rows + more > self.bad.size:
            size = self.rows + int(more * max(pages, 1.0) * 1.02) + 1
            self.values = [_grown(each, self.rows, size) for each in self.values]
            self.form = [_grown(each, self.rows, size) for each in self.form]
            self.bad = _grown(self.bad, self.rows, size)

    def take(self, text: NDArray[np.uint8], pages: float) -> None:
        """Read the rows of one page; ``pages`` like it are left, it included."""
        page = self.page
        page.fill(text)
        lines = _Lines.of(page, self.mark)
        if lines is None:
            unified = text.tobytes().replace(b"\r\n", b"\n").replace(b"\r", b"\n")
            return self.take(np.frombuffer(unified, np.uint8), pages)
        blank = _blank(page.raw, lines)
        if blank is not None or (lines.width and self.width not in (None, lines.regular)):
            lines = _Lines.of(page, self.mark, alike=False) or lines
        if blank is not None:
            self.skipped.append(np.cumsum(~blank)[blank] + self.rows)
            lines = lines.keep(~blank)
        count = lines.stop.size
        if not count:
            return None
        self._make_room(count, pages)
        rows = slice(self.rows, self.rows + count)
        bad = self._wrong_width(page.raw, lines)
        odd = bool(bad.any())
        for k, column in enumerate(self.columns):
            form = self.form[k][rows]
            span = lines.span(page, column)
            usual, padded, plain = read_column(
                span, self.usual[k], self.shifts[k], self.points, self.values[k][rows], form, self.padded[k]
            )
            self.usual[k], self.padded[k] = usual, padded
            if not plain:
                bad |= form == UNREAD if self.width is None else form <= EMPTY
                odd = True
        self.bad[rows] = bad
        for k, form in enumerate(each[rows] for each in self.form):
            if odd:
                self.counts[k] += np.bincount(form[~bad].view(np.uint8), minlength=256)
            else:
                self.counts[k, self.usual[k]] += count
        self.rows += count
        first = lines.span(page, 0)
        self.last = page.raw[int(first.begin[-1]) : int(first.end[-1])].tobytes()
        self.last_cells = int(lines.cells[-1])
        return None

    def _wrong_width(self, raw: NDArray[np.uint8], lines: _Lines) -> NDArray[np.bool_]:
        """Tell rows that have not the cells demanded; separators at the end of a row make no cell."""
        if self.width is None:
            return np.zeros(lines.stop.size, bool)
        bad: NDArray[np.bool_] = lines.cells != self.width
        for row in np.flatnonzero(lines.cells > self.width).tolist():
            begin = int(lines.ends[lines.first[row] + self.width - 1])
            bad[row] = bool(raw[begin : lines.stop[row]].tobytes().strip(bytes((self.mark, _BLANK))))
        return bad

    def table(self, first_line: int, *, ended: bool) -> Table:
        values = tuple(column[: self.rows] for column in self.values)
        form = tuple(column[: self.rows] for column in self.form)
        bad = self.bad[: self.rows]
        counts = self.counts[:, :EXPONENT], self.counts[:, EXPONENT : 2 * EXPONENT]
        exponents = tuple(bool(e.sum() > f.sum()) for f, e in zip(*counts, strict=True))
        usual = tuple(
            _most_frequent(counts[int(exponent)][k]) + EXPONENT * int(exponent) for k, exponent in enumerate(exponents)
        )
        for k, each in enumerate(form):
            cut = self._cut(k, each, usual[k], exponents[k])
            if not ended and self.rows and self._is_cut_last(k, form, usual[k]):
                cut = np.arange(self.rows) == self.rows - 1 if cut is None else cut
                cut[-1] = True
            if cut is not None:
                values[k][cut], each[cut] = np.nan, UNREAD
                bad |= cut
        skipped = np.concatenate(self.skipped) if self.skipped else np.empty(0, np.int64)
        truncated = bool(self.rows) and not ended and bool(bad[-1])
        decimals = tuple(each % EXPONENT for each in usual)
        last = self.last.strip(b" ").decode("ascii", "replace")
        return Table(values, form, bad, decimals, exponents, last, truncated, first_line, skipped)

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

    def _is_cut_last(self, k: int, form: tuple[I1, ...], usual: int) -> bool:
        """Tell whether a last row without line end may have stopped within the cell of a column.

        A number is whole where something follows it, or where it has all the decimals that its column always
        prints. In a column that prints now more, now fewer, or none, nothing shows that the last number is whole,
        so it counts as cut.
        """
        if self.last_cells > self.columns[k] + 1 or form[k][-1] < 0:
            return False
        if usual not in (0, EXPONENT) and self._fixed(k, usual, usual >= EXPONENT):
            return int(form[k][-1]) != usual
        return self.rows > 1


def _most_frequent(counts: I8) -> int:
    """Return the form that occurs most often, the longer of two equally frequent."""
    return int(counts.size - 1 - counts[::-1].argmax()) if counts.any() else 0


def _grown(column: Any, rows: int, size: int) -> Any:
    """Return a longer array that begins with the rows of another."""
    longer = np.empty(size, column.dtype)
    longer[:rows] = column[:rows]
    return longer
