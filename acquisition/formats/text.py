"""Text that holds columns of numbers: decoding, lines, and a table of cells with what could not be read.

Two readers give the same numbers. The fast one takes fixed-point columns as integers, all rows at once. The
slow one goes row by row and says which rows it could not read; it also reads what is out of the ordinary in a
file that is otherwise for the fast one.
"""

from __future__ import annotations

import codecs
import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from acquisition.block import F8, I8
from acquisition.formats.fixed_point import read_cells

__all__ = [
    "Table",
    "decode",
    "guess_delimiter",
    "is_text",
    "parse_number",
    "read_table",
    "split_cells",
    "unify",
]

_NUMBER = re.compile(r"[+-]?(?:\d+\.?(\d*)|\.(\d+))(?:[eE][+-]?\d{1,3})?", re.ASCII)
_CONTROL = bytes(c for c in range(32) if c not in b"\t\n\r\f\x1a")
_NEWLINE = ord("\n")
_SAMPLE = 32  # lines that tell how many decimals a column prints
_UNIFORM = 0.9  # a column that prints the same number of decimals in this share of its rows always does


def is_text(data: bytes) -> bool:
    """Tell whether bytes can be a text: UTF-8, UTF-16 or an 8-bit code with few control characters.

    Examples
    --------
    >>> is_text(b"0.010\\t31.433\\r\\n"), is_text(bytes(range(256)) * 9)
    (True, False)
    """
    head = data[:8192]
    if _utf16(head):
        return True
    head = head.rstrip(b"\0") or head
    return len(head) - len(head.translate(None, _CONTROL)) <= 0.02 * len(head)


def decode(data: bytes) -> str:
    """Decode a text whatever its encoding; a byte that has no meaning becomes U+FFFD and fails as a number.

    Byte order marks are obeyed and removed. UTF-16 without one is known by its zero bytes. What is not UTF-8
    is read as cp1252.

    Examples
    --------
    >>> decode("\\ufeff0,5".encode("utf-16-le")), decode(b"20 \\xb0C")
    ('0,5', '20 °C')
    """
    if data.startswith(codecs.BOM_UTF8):
        data = data[3:]
    elif encoding := _utf16(data[:8192]):
        return data.decode(encoding, errors="replace").removeprefix("\ufeff")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")


def _utf16(head: bytes) -> str:
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16-le" if head.startswith(codecs.BOM_UTF16_LE) else "utf-16-be"
    even, odd = head[::2], head[1::2]
    if len(odd) < 4:
        return ""
    # Digits in UTF-16 have one zero byte each, always on the same side.
    zero_even, zero_odd = even.count(0) / len(even), odd.count(0) / len(odd)
    if zero_odd > 0.8 and zero_even < 0.1:
        return "utf-16-le"
    return "utf-16-be" if zero_even > 0.8 and zero_odd < 0.1 else ""


def unify(text: str) -> str:
    """Turn every line end (CRLF, CR, LF) into LF.

    Examples
    --------
    >>> unify("a\\r\\nb\\rc\\n")
    'a\\nb\\nc\\n'
    """
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def parse_number(cell: str) -> float | None:
    """Read one cell: a decimal number, with a point or a comma, or NaN; None where it is neither.

    Stricter than ``float()``: no ``1_000``, no ``inf``, no digits of other scripts, nothing that overflows.

    Examples
    --------
    >>> parse_number("-8,90E-4"), parse_number("NaN"), parse_number("1_0"), parse_number("1.234,5")
    (-0.00089, nan, None, None)
    """
    if "," in cell and "." not in cell:
        cell = cell.replace(",", ".", 1)
    if not _NUMBER.fullmatch(cell):
        return math.nan if cell.lower() in ("nan", "-nan", "+nan") else None
    value = float(cell)
    return value if math.isfinite(value) else None


def _decimals(cell: str) -> int:
    """Count printed decimals; -1 where a cell has none to compare (NaN, an exponent)."""
    match = _NUMBER.fullmatch(cell.replace(",", ".", 1))
    if match is None or "e" in cell.lower():
        return -1
    return len(match[1] or match[2] or "")


def guess_delimiter(line: str) -> str:
    """Tell what separates the cells of a row; an empty string means runs of white space.

    A comma separates only where nothing else does, for it may be a decimal mark.

    Examples
    --------
    >>> guess_delimiter("0,43;16,5"), guess_delimiter("0.43 16.5"), guess_delimiter("0.43,16.5")
    (';', '', ',')
    """
    for mark in "\t;":
        if mark in line:
            return mark
    return "" if " " in line.strip(" ") or "," not in line else ","


def split_cells(line: str, delimiter: str) -> list[str]:
    """Split a row into stripped cells; separators at the end of the row make no cell.

    Only blanks are stripped: any other white space is damage, and a number beside it may have lost digits.
    """
    if not delimiter:
        return re.findall(r"[^ \t]+", line)
    cells = [cell.strip(" ") for cell in line.split(delimiter)]
    while cells and not cells[-1]:
        cells.pop()
    return cells


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Rows of numbers.

    Parameters
    ----------
    values : (rows, columns) float64
        NaN where a cell says so or could not be read.
    line : (rows,) int64
        One-based line of each row in the file.
    bad : (rows,) bool
        Rows that could not be read.
    decimals : tuple of int
        Decimals printed in each column.
    unread : dict of int to str
        The first cell of each bad row, as printed, by row.
    """

    values: F8
    line: I8
    bad: NDArray[np.bool_]
    decimals: tuple[int, ...]
    unread: dict[int, str] = field(default_factory=dict)


def read_table(body: str, columns: int, delimiter: str, first_line: int = 1, *, fast: bool = True) -> Table:
    """Read rows of numbers.

    Parameters
    ----------
    body : str
        Rows, ended by LF; the last may lack its end.
    columns : int
        Cells that a row must have.
    delimiter : str
        What separates them; empty for runs of white space.
    first_line : int
        One-based line of the file where ``body`` starts.
    fast : bool
        Whether to try all rows at once first. The result is the same.

    Returns
    -------
    Table
        Empty lines make no row. A row is bad where its cells are not as many as demanded, where one is not a
        number, or where one has other decimals than its column always prints: such a number was cut.

    Examples
    --------
    >>> read_table("0.010\\t25.334\\n0.020\\t25.648\\n0.030\\t0.", 2, "\\t").bad.tolist()
    [False, False, True]
    """
    found = _all_at_once(body, columns, delimiter) if fast and delimiter else None
    rows = found or _row_by_row(body, columns, delimiter, _every_line(body))
    usual = tuple(_usual(rows.decimals[~rows.bad, column]) for column in range(columns))
    bad = rows.bad | _cut(rows.decimals, rows.bad, usual, ended=body.endswith("\n"))
    unread = {
        row: (split_cells(body[rows.start[row] : rows.stop[row]], delimiter) or [""])[0]
        for row in np.flatnonzero(bad).tolist()
    }
    return Table(rows.values, first_line + rows.line, bad, usual, unread)


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """Rows as they stand, before any is found to have been cut.

    Parameters
    ----------
    values : (rows, columns) float64
    decimals : (rows, columns) int64
        Printed decimals; -1 where a cell has none to compare.
    bad : (rows,) bool
    line : (rows,) int64
        Number of line ends before the row.
    start, stop : (rows,) int64
        Where the row stands in the text.
    """

    values: F8
    decimals: I8
    bad: NDArray[np.bool_]
    line: I8
    start: I8
    stop: I8

    def merge(self, keep: NDArray[np.bool_], other: _Rows) -> _Rows:
        """Return the rows kept and those of another, in the order of their lines."""
        order = np.argsort(np.concatenate((self.line[keep], other.line)), kind="stable")
        both = {
            name: np.concatenate((getattr(self, name)[keep], getattr(other, name)))[order] for name in self.__slots__
        }
        return _Rows(**both)


def _all_at_once(body: str, columns: int, delimiter: str) -> _Rows | None:
    """Read rows of fixed point (or NaN) together and the odd ones singly; None where fixed point is not usual."""
    ended = body if body.endswith("\n") else f"{body}\n"
    # What is not ASCII becomes one byte as well, one that no number has.
    raw = np.frombuffer(ended.encode("ascii", "replace"), np.uint8)
    ends = np.flatnonzero((raw == _NEWLINE) | (raw == ord(delimiter)))
    last = np.flatnonzero(raw[ends] == _NEWLINE)
    stop = ends[last]
    start = np.concatenate(([0], stop[:-1] + 1))
    some = np.flatnonzero(stop > start)
    sample = some[np.linspace(0, some.size - 1, min(some.size, _SAMPLE)).astype(np.int64)] if some.size else some
    usual = _usual_decimals([body[start[row] : stop[row]] for row in sample.tolist()], columns, delimiter)
    if min(usual, default=0) < 1:
        return None
    regular = some[np.diff(last, prepend=-1)[some] == columns]
    cell_ends = ends[last[regular, np.newaxis] + np.arange(1 - columns, 1)]
    points = b"." if delimiter == "," else b".,"
    values, decimals = np.empty((regular.size, columns)), np.empty((regular.size, columns), np.int64)
    plain = np.ones(regular.size, bool)
    begin = start[regular]
    for column in range(columns):
        end = np.ascontiguousarray(cell_ends[:, column])
        values[:, column], good = read_cells(raw, begin, end, usual[column], points)
        decimals[:, column] = np.where(np.isnan(values[:, column]), -1, usual[column])
        plain &= good
        begin = end + 1
    read = _Rows(values, decimals, ~plain, regular, start[regular], stop[regular])
    odd = np.ones(last.size, bool)
    odd[regular[plain]] = odd[stop == start] = False
    if not odd.any():
        return read
    lines = ((row, int(start[row]), int(stop[row])) for row in np.flatnonzero(odd).tolist())
    return read.merge(plain, _row_by_row(body, columns, delimiter, lines))


def _usual_decimals(lines: list[str], columns: int, delimiter: str) -> tuple[int, ...]:
    """Return the decimals that each column prints most often in some lines; 0 where none has any."""
    rows = [cells for line in lines if len(cells := split_cells(line, delimiter)) == columns]
    printed = np.array([[_decimals(cell) for cell in cells] for cells in rows], np.int64).reshape(-1, columns)
    return tuple(_usual(printed[:, column]) for column in range(columns))


def _every_line(body: str) -> Iterator[tuple[int, int, int]]:
    """Yield every line's number, counted from 0, and where it starts and stops."""
    start = 0
    for number, text in enumerate(body.split("\n")):
        yield number, start, start + len(text)
        start += len(text) + 1


def _row_by_row(body: str, columns: int, delimiter: str, lines: Iterable[tuple[int, int, int]]) -> _Rows:
    """Read the lines given, each by itself; blank ones make no row."""
    values: list[list[float]] = []
    decimals: list[list[int]] = []
    places: list[tuple[int, int, int]] = []
    bad: list[bool] = []
    for place in lines:
        text = body[place[1] : place[2]]
        if not text.strip(" \t"):
            continue
        cells = split_cells(text, delimiter)
        numbers = [parse_number(cell) for cell in cells]
        places.append(place)
        bad.append(len(cells) != columns or None in numbers)
        padded = [*(math.nan if x is None else x for x in numbers), *[math.nan] * columns]
        values.append(padded[:columns])
        decimals.append([*(_decimals(cell) for cell in cells), *[-1] * columns][:columns])
    line, start, stop = np.array(places, np.int64).reshape(-1, 3).T
    table = np.array(values, float).reshape(-1, columns)
    printed = np.array(decimals, np.int64).reshape(-1, columns)
    return _Rows(table, printed, np.array(bad, bool), line, start, stop)


def _usual(printed: I8) -> int:
    """Return the decimals that a column prints most often, the more of two equally frequent."""
    known = printed[printed >= 0]
    return int(known.size and known.max() - np.bincount(known)[::-1].argmax())


def _cut(printed: I8, bad: NDArray[np.bool_], usual: tuple[int, ...], *, ended: bool) -> NDArray[np.bool_]:
    """Find rows with a number that lost some of its decimals, or grew others."""
    differs = (printed >= 0) & (printed != np.array(usual))
    cut = np.zeros(bad.size, bool)
    for column in range(differs.shape[1]):
        if np.count_nonzero(~differs[~bad, column]) >= _UNIFORM * np.count_nonzero(~bad):
            cut |= differs[:, column]
    # A last row without line end may have stopped anywhere: there fewer decimals than usual are enough.
    if bad.size and not ended:
        cut[-1] |= bool(((printed[-1] >= 0) & (printed[-1] < np.array(usual))).any())
    return cut
