"""Rows of numbers: the one reader of cells behind every text format.

Rows are read by :func:`numpy.loadtxt`, a page of whole lines at a time. What it reads as a number and a recording does
not, what it refuses, and how many decimals each cell prints, is judged here: a page that is not regular is halved until
its regular rows are read together and a few others one by one.

Columns of fixed point go through loadtxt as whole numbers, their points taken out: 12,000 rows of three columns take it
0.9 ms so, and 6.5 ms as decimal fractions (pandas 2.3 ms on the same cores). One division then puts the point back, and
whatever power of ten makes SI units, rounded once, as ``float()`` rounds.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.block import F8, I8
from acquisition.recordings.tables.text import Text, parse_number, printed_decimals

__all__ = ["EMPTY", "EXPONENT", "NAN", "UNREAD", "Table", "read_table"]

EXPONENT = 64
"""Added to the decimals in a form where the number has an exponent."""
NAN, EMPTY, UNREAD = -1, -2, -3

I1 = NDArray[np.int8]
Mask = NDArray[np.bool_]

_PAGE_BYTES = 1 << 16
_MIXED_ROWS = 512  # more rows that are not all of fixed point are halved: most of them may be
_SINGLE_ROWS = 32  # so few are read one by one
_MOST_DIGITS = 15  # whole numbers of so many digits and powers of ten up to 10^22 are exact in binary, so that their
_MOST_POWER = 22  # quotient is rounded once
_LONGEST_EXPONENT = len("e-99")
_UNIFORM = 0.9  # a column that prints the same number of decimals in this share of its rows always does
_MANY, _STRIPPED = 40, 0.03
_LINE_END = re.compile(rb"\r\n?|\n")
_NEWLINE, _BLANK, _MINUS, _POINT, _ZERO, _E, _LOWER = (*(ord(c) for c in "\n -.0e"), 0x20)


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
    text : (rows,) bool
        Rows that begin with what is no number, where a column asked for is none either.
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
    bad: Mask
    text: Mask
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
    data = text.data
    most = data.count(b"\n", start, stop) + data.count(b"\r", start, stop) + 1
    rows = _Rows(tuple(columns), delimiter, width, tuple(shifts) or (0,) * len(columns), most)
    for page in _pages(data, start, stop):
        rows.take(page)
    return rows.table(first_line, ended=start >= stop or data[stop - 1 : stop] in (b"\n", b"\r"))


def _pages(data: bytes, start: int, stop: int) -> Iterator[bytes]:
    """Yield some whole lines after the other."""
    while start < stop:
        end = min(start + _PAGE_BYTES, stop)
        if end < stop:
            # A page ends behind a LF, or behind a CR that is no half of CRLF, or where its one line does.
            whole = data.rfind(b"\n", start, end) + 1 or data.rfind(b"\r", start, end - 1) + 1
            if not whole:
                found = _LINE_END.search(data, end - 1, stop)
                whole = found.end() if found else stop
            end = whole
        yield data[start:end]
        start = end


def _unified(page: bytes, delimiter: str) -> bytes:
    """End lines by LF, separate by one tab instead of white space, take quotes off cells, put points for commas."""
    if b"\r" in page:
        page = page.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if not page.endswith(b"\n"):
        page += b"\n"
    if b'"' in page:
        mark = re.escape((delimiter or "\t").encode())
        page = re.sub(rb'(?<![^%b\n])"([^"%b\n]*)"(?![^%b\n])' % (mark, mark, mark), rb"\1", page)
    if not delimiter:
        page = page.replace(b" ", b"\t")
        while b"\t\t" in page:
            page = page.replace(b"\t\t", b"\t")
        page = page.replace(b"\t\n", b"\n").replace(b"\n\t", b"\n").removeprefix(b"\t")
    return page if delimiter in (",", ".") else page.replace(b",", b".")


class _Column(NamedTuple):
    """One column of some rows: its numbers, their forms, and which print a zero as their last decimal."""

    values: F8
    form: I1 | int
    zero: Mask


class _Rows:
    """Gathers rows, one page after the other."""

    def __init__(
        self, columns: tuple[int, ...], delimiter: str, width: int | None, shifts: tuple[int, ...], most: int
    ) -> None:
        self.columns, self.width, self.shifts = columns, width, shifts
        self.delimiter, self.mark = delimiter, delimiter or "\t"
        self.values = [np.empty(most) for _ in columns]
        self.form = [np.empty(most, np.int8) for _ in columns]
        self.bad = np.zeros(most, bool)
        self.text = np.zeros(most, bool)
        # How many numbers of each form a column holds, and how many of them end in a zero.
        self.counts = np.zeros((len(columns), 2 * EXPONENT), np.int64)
        self.zeros = np.zeros((len(columns), 2 * EXPONENT), np.int64)
        self.rows = 0
        self.skipped: list[int] = []
        self.last: list[str] = []

    def take(self, lines: bytes) -> None:
        """Read some lines."""
        found = self._read_whole(lines)
        if found is None:
            lines = _unified(lines, self.delimiter)
            rows = lines.count(b"\n")
            found = self._read_mixed(lines) if rows <= _MIXED_ROWS else None
        if found is not None:
            self._add(found)
            self._note_last(lines)
        elif rows <= _SINGLE_ROWS:
            for line in lines.decode("ascii", "replace").split("\n")[:-1]:
                self._take_single(line)
        else:
            middle = len(lines) // 2
            middle = lines.rfind(b"\n", 0, middle) + 1 or lines.find(b"\n", middle) + 1
            self.take(lines[:middle])
            self.take(lines[middle:])

    def _read_whole(self, lines: bytes) -> list[_Column] | None:
        """Read lines of fixed point, each column with as many decimals throughout; None where they are anything else.

        What is left of such lines without digits and signs is the same for each: separators, and a point a cell.
        """
        skeleton = lines.translate(None, b"0123456789+-")
        first = skeleton[: skeleton.find(b"\n") + 1]
        ended = lines.endswith(b"\n") and self.mark not in "+-."
        if not ended or skeleton != first * (len(skeleton) // len(first)):
            return None
        cells = lines[: lines.find(b"\n")].decode("ascii", "replace").rstrip("\r").split(self.mark)
        if self.width not in (None, len(cells)) or max(self.columns) >= len(cells):
            return None
        printed = [cells[column] for column in self.columns]
        decimals = [printed_decimals(cell) for cell in printed]
        if any(
            parse_number(cell) is None or ("." in cell) != (n > 0) for cell, n in zip(printed, decimals, strict=True)
        ):
            return None
        raw = np.frombuffer(lines, np.uint8)
        marks = np.flatnonzero((raw == ord(self.mark)) | (raw == _NEWLINE))
        length = np.concatenate((marks[:1], np.diff(marks) - 1)).reshape(-1, len(cells))
        ends = marks.reshape(length.shape)
        if first.endswith(b"\r\n"):
            ends[:, -1] -= 1
            length[:, -1] -= 1
        if length.max() > _MOST_DIGITS:
            return None
        for column, places in zip(self.columns, decimals, strict=True):
            point = places > 0
            if length[:, column].min() <= places + point:
                return None
            if point and (raw[ends[:, column] - places - 1] != _POINT).any():
                return None
        whole = self._load(lines.translate(None, b".\r"), np.int64)
        powers = [places - shift for places, shift in zip(decimals, self.shifts, strict=True)]
        if whole is None or max(map(abs, powers)) > _MOST_POWER:
            return None
        found = []
        for k, (column, places, power) in enumerate(zip(self.columns, decimals, powers, strict=True)):
            number, end = whole[:, k], ends[:, column]
            values = number / 10.0**power if power >= 0 else number * 10.0**-power
            zeros = np.flatnonzero(number == 0)
            if zeros.size:
                values[zeros[raw[(end - length[:, column])[zeros]] == _MINUS]] = -0.0
            found.append(_Column(values, places, raw[end - 1] == _ZERO))
        return found

    def _read_mixed(self, lines: bytes) -> list[_Column] | None:
        """Read lines of as many cells each, those asked for numbers of any form; None where they are anything else."""
        raw = np.frombuffer(lines, np.uint8)
        mark, rows = ord(self.mark), lines.count(b"\n")
        marks = np.flatnonzero((raw == mark) | (raw == _NEWLINE))
        cells = marks.size // rows
        if marks.size != rows * cells or max(self.columns) >= cells:
            return None
        ends = marks.reshape(rows, cells)
        if (raw[ends[:, -1]] != _NEWLINE).any():
            return None
        # loadtxt strips every kind of white space, which is damage here: a number beside it may have lost digits.
        if np.count_nonzero(raw < _BLANK) != (ends.size if mark < _BLANK else rows):
            return None
        if self.width is not None and (cells < self.width or (np.diff(ends[:, self.width - 1 :]) != 1).any()):
            return None
        bounds = [(_begins(ends, column), ends[:, column]) for column in self.columns]
        if any(((end == begin) | (raw[end - 1] == _BLANK)).any() for begin, end in bounds):
            return None
        table = self._load(lines, np.float64)
        if table is None or np.isinf(table).any():  # the word, or a number that overflows
            return None
        points, letters = np.flatnonzero(raw == _POINT), np.flatnonzero((raw | _LOWER) == _E)
        found = []
        for values, (begin, end), shift in zip(table.T, bounds, self.shifts, strict=True):
            power = _last(letters, begin, end)
            if (end - power > _LONGEST_EXPONENT).any(where=power >= 0):
                return None
            ahead = np.where(power >= 0, power, end)
            point = _last(points, begin, ahead)
            form = np.where(point >= 0, np.minimum(ahead - point - 1, EXPONENT - 1), 0) + EXPONENT * (power >= 0)
            form[np.isnan(values)] = NAN
            if shift:  # read again, to be rounded once
                places = zip(begin.tolist(), end.tolist(), strict=True)
                values = np.array([_single(lines[at:stop].decode("ascii").strip(" "), shift)[0] for at, stop in places])
            found.append(_Column(values, form.astype(np.int8), raw[ahead - 1] == _ZERO))
        return found

    def _load(self, lines: bytes, dtype: type[np.generic]) -> NDArray[Any] | None:
        """Hand lines that are not empty to numpy.loadtxt; None where a cell asked for is no number, or not ASCII."""
        try:
            rows = lines.decode("ascii").split("\n")
            return np.loadtxt(rows, dtype, None, self.mark, usecols=self.columns, ndmin=2)
        except ValueError:
            return None

    def _add(self, columns: list[_Column]) -> None:
        """Append rows that are all sound."""
        rows = slice(self.rows, self.rows + columns[0].values.size)
        for k, (values, form, zero) in enumerate(columns):
            self.values[k][rows], self.form[k][rows] = values, form
            if isinstance(form, int):
                self.counts[k, form] += values.size
                self.zeros[k, form] += np.count_nonzero(zero)
            else:
                self.counts[k] += np.bincount(form[form >= 0], minlength=2 * EXPONENT)
                self.zeros[k] += np.bincount(form[zero & (form >= 0)], minlength=2 * EXPONENT)
        self.rows = rows.stop

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
            value, form = _single(cell, shift)
            self.values[k][row], self.form[k][row] = value, form
            forms.append(form)
        self.text[row] = bool(cells[0]) and parse_number(cells[0]) is None
        if self.width is None:
            self.bad[row] = UNREAD in forms
        else:
            self.bad[row] = len(cells) < self.width or any(cells[self.width :]) or min(forms) <= EMPTY
        if not self.bad[row]:
            for k, (cell, form) in enumerate(zip(wanted, forms, strict=True)):
                if form >= 0:
                    self.counts[k, form] += 1
                    self.zeros[k, form] += cell.lower().partition("e")[0].endswith("0")

    def _note_last(self, lines: bytes) -> None:
        """Keep the cells of the last line."""
        last = lines[lines.rfind(b"\n", 0, -1) + 1 : -1]
        self.last = [cell.strip(" ") for cell in last.decode("ascii", "replace").rstrip("\r").split(self.mark)]

    def table(self, first_line: int, *, ended: bool) -> Table:
        """Return the rows taken, with numbers that were cut marked."""
        values = [column[: self.rows] for column in self.values]
        form = [column[: self.rows] for column in self.form]
        bad, text = self.bad[: self.rows], self.text[: self.rows]
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
                bad |= cut
        if 0 in self.columns:
            text = form[self.columns.index(0)] == UNREAD
        return Table(
            tuple(values),
            tuple(form),
            bad,
            text,
            tuple(each % EXPONENT for each in usual),
            tuple(exponents),
            self.last[0] if self.last else "",
            cut=bool(self.rows) and not ended and bool(bad[-1]),
            first_line=first_line,
            skipped=np.array(self.skipped, np.int64),
        )

    def _fixed(self, k: int, usual: int, exponent: bool) -> bool:
        """Tell whether a column always prints the same number of decimals."""
        counts = self.counts[k]
        numbers = int(counts[: 2 * EXPONENT if exponent else EXPONENT].sum())
        others = numbers - int(counts[usual])
        # Where zeros at the end are not printed, a tenth of the numbers is shorter and none ends in zero.
        padded = usual % EXPONENT and self.zeros[k, usual]
        stripped = others >= _STRIPPED * numbers and numbers >= _MANY and not padded
        return others <= (1 - _UNIFORM) * numbers and not stripped

    def _cut(self, k: int, form: I1, usual: int, exponent: bool) -> Mask | None:
        """Find numbers that lost some of their decimals, or grew others; None where there is none."""
        if self.counts[k].sum() == self.counts[k][usual] or not self._fixed(k, usual, exponent):
            return None
        # Where exponents are the exception, a number with one is as good as any.
        differs: Mask = (form >= 0) & (form != usual) & (exponent | (form < EXPONENT))
        return differs if differs.any() else None

    def _is_cut_last(self, k: int, form: I1, usual: int) -> bool:
        """Tell whether a last row without line end may have stopped within the cell of a column.

        A number is whole where something follows it, or where it has all the decimals that its column always
        prints. In a column that prints now more, now fewer, or none, nothing shows that the last number is whole,
        so it counts as cut.
        """
        if len(self.last) > self.columns[k] + 1 or form[-1] < 0:
            return False
        if usual not in (0, EXPONENT) and self._fixed(k, usual, usual >= EXPONENT):
            return int(form[-1]) != usual
        return self.rows > 1


def _begins(ends: I8, column: int) -> I8:
    """Return where the cells of a column begin, from where all cells of each row end."""
    return ends[:, column - 1] + 1 if column else np.concatenate(([0], ends[:-1, -1] + 1))


def _last(places: I8, begin: I8, end: I8) -> I8:
    """Return the last of increasing places that lies within each cell; -1 where none does."""
    if not places.size:
        return np.full(begin.size, -1)
    found = places[np.searchsorted(places, end) - 1]  # before the first one this is the last of all, behind the cell
    return np.where((found >= begin) & (found < end), found, -1)


def _unquoted(cell: str) -> str:
    """Take blanks off a cell, and a pair of quotes."""
    cell = cell.strip(" ")
    return cell[1:-1].strip(" ") if len(cell) > 1 and cell[0] == cell[-1] == '"' else cell


def _single(cell: str, shift: int) -> tuple[float, int]:
    """Read one cell by itself; return its number, NaN where it is none, and its form."""
    if not cell:
        return np.nan, EMPTY
    value = parse_number(cell, shift)
    if value is None:
        return np.nan, UNREAD
    if value != value:
        return value, NAN
    return value, min(printed_decimals(cell), EXPONENT - 1) + (EXPONENT if "e" in cell.lower() else 0)


def _most_frequent(counts: I8) -> int:
    """Return the form that occurs most often, the longer of two equally frequent."""
    return int(counts.size - 1 - counts[::-1].argmax()) if counts.any() else 0
