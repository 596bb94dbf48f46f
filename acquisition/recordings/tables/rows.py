"""Read all rows of a text, or of a sheet of a workbook, as columns of numbers."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest

import numpy as np

from acquisition.block import B1, F8
from acquisition.errors import FormatError
from acquisition.recordings.recording import Trap
from acquisition.recordings.tables.cells import EMPTY, EXPONENT, I1, UNREAD, cell, is_cut, read_cells, split_page
from acquisition.recordings.tables.clock import clock_s
from acquisition.recordings.tables.table import Column, Lines
from acquisition.recordings.tables.text import Line, Text

_FIRST_ROWS = 4
_MOST_EMPTY = 4_000_000
"""Cells that rows may lack, in addition to one for every byte, before the table counts as damaged."""
_DIGITS, _MOST_DECIMALS = 15, 12  # the significant digits that spreadsheet programs show; more decimals: an exponent

_REMEDY = "export the numbers without thousands separators"
_GROUP = rb"[-+]?[1-9]\d{0,2}"
_THOUSANDS = re.compile(
    _GROUP
    + rb"(?:(?:,\d{3})+\.\d*|(?:\.\d{3})+,\d*|(?:,\d{3}){2,}|(?:\.\d{3}){2,}"
    + rb"|(?:(?: |'|\xc2\xa0|\xa0|\xe2\x80\xaf|\xe2\x80\x99)\d{3})+(?:[.,]\d*)?)(?:[eE][-+]?\d+)?"
)


@dataclass(frozen=True, slots=True, eq=False)
class Sheet:
    """The cells of a sheet of a workbook, by column: numbers, or text."""

    columns: tuple[tuple[float | str, ...], ...]
    zeros: int = 0

    def head(self, limit: int, start: int | None = None, number: int = 1) -> list[Line]:
        """Return the first rows as lines of text between tabs, like those of a :class:`Text`."""
        del start
        rows = zip(*(column[number - 1 : number - 1 + limit] for column in self.columns), strict=True)
        return [Line(at, at, at + 1, "\t".join(map(_printed, row))) for at, row in enumerate(rows, number)]


def _printed(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.{_DIGITS}g}"


@dataclass(slots=True)
class _Gathered:
    """The pages of each column that have been read, and the number of rows in them."""

    rows: int = 0
    pieces: list[list[tuple[F8, I1]]] = field(default_factory=list)
    sizes: list[int] = field(default_factory=list)

    def add(self, columns: Sequence[tuple[F8, I1]], rows: int) -> None:
        """Append a page; a column that was not there before begins with empty cells."""
        for at, (values, decimals) in enumerate(columns):
            if at == len(self.pieces):
                self.pieces.append([])
                self.sizes.append(0)
            if missing := self.rows - self.sizes[at]:
                self.pieces[at].append((np.full(missing, np.nan), np.full(missing, EMPTY, np.int8)))
            self.pieces[at].append((values, decimals))
            self.sizes[at] = self.rows + rows
        self.rows += rows

    def columns(self) -> Iterator[Column]:
        """Yield the columns without names; each may end before the last row."""
        for pieces in self.pieces:
            values, decimals = (np.concatenate(each) for each in zip(*pieces, strict=True))
            pieces.clear()
            yield Column("", "", values, decimals)


def read_rows(
    path: str,
    text: Text | Sheet,
    first: Line,
    mark: str,
    *,
    stop: int | None = None,
    clock: int | None = None,
    brackets: bool = False,
) -> tuple[list[Column], Lines, tuple[Trap, ...]]:
    """Read the rows from line ``first`` on, as columns without names.

    Blank lines are no rows. The cells of column ``clock`` are times of day. With brackets, ``[``, ``]`` and ``;`` are
    blanks. The remarks are on the file as a whole.

    >>> text = Text.of(b"0.010\\t25.334\\n0.020\\t25.648\\n0.030\\t0.")
    >>> columns, lines, _ = read_rows("run.txt", text, text.head(1)[0], "\\t")
    >>> [column.values.tolist() for column in columns], lines.cut
    ([[0.01, 0.02, 0.03], [25.334, 25.648, nan]], True)
    """
    if isinstance(text, Sheet):
        return _of_sheet(text, first.number, clock)
    stop = text.stop if stop is None else stop
    gathered, marks, skipped = _Gathered(), _Marks(path, bool(mark)), list[int]()
    most = stop - first.start + _MOST_EMPTY
    cells: tuple[tuple[str, ...], ...] = ()
    last: list[bytes] = []
    for page in text.pages(first.start, stop):
        rows = []
        for line in split_page(page, mark, brackets=brackets):
            if line:
                rows.append(line)
            else:
                skipped.append(gathered.rows + len(rows))
        if not rows:
            continue
        most -= len(rows) * max(map(len, rows))
        if most < 0:
            raise FormatError(path, "expected rows of like length, got a few much longer rows", "split the file")
        columns = []
        for at, column in enumerate(zip_longest(*rows, fillvalue=b"")):
            if at == clock:
                columns.append(_clock_times(column))
                continue
            values, decimals, commas = read_cells(column)
            marks.look(at, column, values, decimals, commas)
            columns.append((values, decimals))
        gathered.add(columns, len(rows))
        cells = cells or tuple(tuple(each.decode("latin-1") for each in row) for row in rows[:_FIRST_ROWS])
        last = rows[-1]
    ended = first.start >= stop or text.data[stop - 1 : stop] in (b"\n", b"\r")
    count, read = gathered.rows, list(gathered.columns())
    traps = marks.judged(read)
    cut = False
    if count and not ended:
        own = len(last) - 1
        if is_cut(read[own].values, _decimals(read[own])):
            read[own].values[-1], _decimals(read[own])[-1] = np.nan, UNREAD
        cut = any(column.values.size == count and _decimals(column)[-1] == UNREAD for column in read)
    if clock is not None and clock < len(read):
        read[clock] = _since_first(read[clock])
    words = read[0].of_size(count).decimals == UNREAD if read else np.zeros(0, bool)
    last_cell = last[0].decode("latin-1").replace(",", ".") if last else ""
    lines = Lines(first.number, count, np.array(skipped, np.int64), words, ended, cut, last_cell, text.zeros, cells)
    return read, lines, traps


def _decimals(column: Column) -> I1:
    assert column.decimals is not None
    return column.decimals


def _clock_times(cells: Sequence[bytes]) -> tuple[F8, I1]:
    """Return times of day in seconds, and the decimals of each."""
    values, decimals = np.full(len(cells), np.nan), np.full(len(cells), UNREAD, np.int8)
    for row, each in enumerate(cells):
        if (time := clock_s(each.decode("latin-1").strip('"'))) is not None:
            _, values[row], decimals[row] = time
    return values, decimals


def _since_first(column: Column) -> Column:
    """Return times of day as seconds since the first one; midnight may lie between them."""
    decimals = _decimals(column)
    known = np.flatnonzero(decimals >= 0)
    if known.size:
        at = column.values[known]
        days = np.concatenate(([0.0], np.cumsum(np.diff(at) < -43200.0)))
        for row, since in zip(known.tolist(), (at - at[0] + 86400.0 * days).tolist(), strict=True):
            column.values[row] = round(since, int(decimals[row]))
    return column


def _of_sheet(sheet: Sheet, first: int, clock: int | None) -> tuple[list[Column], Lines, tuple[Trap, ...]]:
    read = []
    for at, cells in enumerate(sheet.columns):
        values, decimals = np.full(len(cells) - first + 1, np.nan), np.full(len(cells) - first + 1, EMPTY, np.int8)
        printed = [_printed(each) for each in cells if not isinstance(each, str)]
        most = max((_DIGITS if "e" in each else len(each.partition(".")[2]) for each in printed), default=0)
        form = most if most <= _MOST_DECIMALS else _DIGITS - 1 + EXPONENT
        for row, each in enumerate(cells[first - 1 :]):
            if at == clock:
                (values[row],), (decimals[row],) = _clock_times([_printed(each).encode("latin-1", "replace")])
            else:
                values[row], decimals[row] = cell(each) if isinstance(each, str) else (each, form)
        read.append(Column("", "", values, decimals))
    filled = np.any([_decimals(column) != EMPTY for column in read], axis=0)
    skipped = np.cumsum(filled)[~filled].astype(np.int64)
    read = [Column("", "", column.values[filled], _decimals(column)[filled]) for column in read]
    if clock is not None:
        read[clock] = _since_first(read[clock])
    head = tuple(zip(*(map(_printed, column[first - 1 : first - 1 + _FIRST_ROWS]) for column in sheet.columns)))
    return read, Lines(first, int(filled.sum()), skipped, _decimals(read[0]) == UNREAD, cells=head), ()


class _Marks:
    """Finds thousands separators (``1,234.5``): reading one as a decimal mark gives an error of a factor 1000.

    A comma or point is a decimal mark if anywhere it is not followed by exactly three digits, or follows a zero or four
    digits.
    """

    def __init__(self, path: str, by_mark: bool) -> None:
        self.path, self.by_mark = path, by_mark
        self.decimal: set[bytes] = set()
        self.doubtful: dict[tuple[int, bytes], bytes] = {}

    def look(self, at: int, cells: Sequence[bytes], values: F8, decimals: I1, commas: B1) -> None:
        """Look at the cells of column ``at`` in one page."""
        if self.by_mark:
            for row in np.flatnonzero(decimals == UNREAD).tolist():
                if _THOUSANDS.fullmatch(cells[row]):
                    raise self._refusal(f"expected plain numbers, got a thousands separator in {_shown(cells[row])}")
        places = decimals % EXPONENT
        numbers = decimals >= 0
        with np.errstate(invalid="ignore"):
            group = (places == 3) & (decimals < EXPONENT) & (np.abs(values) >= 1.0) & (np.abs(values) < 1000.0)
        for mark, marked in ((b",", numbers & commas), (b".", numbers & ~commas & (places > 0))):
            if mark not in self.decimal and marked.any():
                if (marked & ~group).any():
                    self.decimal.add(mark)
                else:
                    self.doubtful.setdefault((at, mark), cells[int(marked.argmax())])

    def judged(self, columns: Sequence[Column]) -> tuple[Trap, ...]:
        """Refuse doubtful numbers; return a remark if a comma was read as a decimal mark, which nothing confirms."""
        shown = b""
        for (at, mark), number in self.doubtful.items():
            if mark in self.decimal:
                continue
            values = np.abs(columns[at].values[_decimals(columns[at]) == 0])
            whole = values.size and values.max() < 1000.0
            if whole or self.decimal:
                raise self._refusal(f"{_shown(number)} may have a thousands separator or a decimal mark")
            if mark == b",":
                shown = shown or number
        points = b"." in self.decimal or any(mark == b"." for _, mark in self.doubtful)
        if not shown or points:
            return ()
        message = f"the comma in {_shown(shown)} was read as a decimal comma, not as a thousands separator"
        return (Trap("decimal_comma", message),)

    def _refusal(self, problem: str) -> FormatError:
        return FormatError(self.path, problem, _REMEDY)


def _shown(number: bytes) -> str:
    return f'"{number.decode("utf-8", "replace")}"'


