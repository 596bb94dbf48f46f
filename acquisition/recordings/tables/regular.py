"""Lines alike: those of a page whose cells are all numbers, read together by :func:`numpy.loadtxt`.

What numpy reads as a number and a recording does not, and how many decimals each cell prints, is judged here; a page
that is not regular is refused, and :mod:`acquisition.recordings.tables.table` reads its rows one by one.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.block import F8, I8
from acquisition.recordings.tables.text import parse_number, printed_decimals

__all__ = ["EMPTY", "EXPONENT", "I1", "NAN", "UNREAD", "Alike", "read_regular", "read_single", "unified"]

EXPONENT = 64
"""Added to the decimals in a form where the number has an exponent."""
NAN, EMPTY, UNREAD = -1, -2, -3

I1 = NDArray[np.int8]

_MOST_WHOLE = 1e15  # whole numbers below this and powers of ten up to 10^22 are exact in binary, so that their
_TENS = np.array([float(f"1e{power}") for power in range(23)])  # quotient is rounded once
_LONGEST_EXPONENT = len("e-99")
_QUOTED_COMMA = re.compile(rb'"([-+]?\d*),(\d+(?:[eE][-+]?\d+)?)"')  # a decimal comma where commas separate
_NEWLINE, _BLANK, _POINT, _E, _LOWER = (*(ord(c) for c in "\n .e"), 0x20)


class Alike(NamedTuple):
    """One column of some rows: its numbers, their forms, where its cells end."""

    values: F8
    form: I1
    last: I8
    """Bytes of the last digit of each number, of its mantissa if it has an exponent."""


def unified(page: bytes, delimiter: str) -> bytes:
    """End lines by LF, separate by one tab instead of white space, take quotes off cells, put points for commas."""
    if b"\r" in page:
        page = page.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if not page.endswith(b"\n"):
        page += b"\n"
    if b'"' in page:
        if delimiter == ",":
            page = _QUOTED_COMMA.sub(rb"\1.\2", page)
        mark = re.escape((delimiter or "\t").encode())
        page = re.sub(rb'(?<![^%b\n])"([^"%b\n]*)"(?![^%b\n])' % (mark, mark, mark), rb"\1", page)
    if not delimiter:
        page = page.replace(b" ", b"\t")
        while b"\t\t" in page:
            page = page.replace(b"\t\t", b"\t")
        page = page.replace(b"\t\n", b"\n").replace(b"\n\t", b"\n").removeprefix(b"\t")
    return page if delimiter in (",", ".") else page.replace(b",", b".")


def read_regular(
    lines: bytes, mark: str, columns: Sequence[int], width: int | None, shifts: Sequence[int]
) -> list[Alike] | None:
    """Read lines of as many cells each, those asked for numbers of any form; None where they are anything else.

    Parameters
    ----------
    lines : bytes
        As :func:`unified` leaves them.
    mark : str
        What separates cells, one character.
    columns, width, shifts
        See :func:`acquisition.recordings.tables.table.read_table`.
    """
    raw = np.frombuffer(lines, np.uint8)
    rows = lines.count(b"\n")
    marks = np.flatnonzero((raw == ord(mark)) | (raw == _NEWLINE))
    cells = marks.size // rows
    if marks.size != rows * cells or max(columns) >= cells:
        return None
    ends = marks.reshape(rows, cells)
    if (raw[ends[:, -1]] != _NEWLINE).any():
        return None
    # loadtxt strips every kind of white space, which is damage here: a number beside it may have lost digits.
    if np.count_nonzero(raw < _BLANK) != (ends.size if ord(mark) < _BLANK else rows):
        return None
    if width is not None and (cells < width or (np.diff(ends[:, width - 1 :]) != 1).any()):
        return None
    bounds = [(_begins(ends, column), ends[:, column]) for column in columns]
    if any(((end == begin) | (raw[end - 1] == _BLANK)).any() for begin, end in bounds):
        return None
    table = _load(lines, mark, columns, cells)
    if table is None or np.isinf(table).any():  # the word, or a number that overflows
        return None
    points, letters = np.flatnonzero(raw == _POINT), np.flatnonzero((raw | _LOWER) == _E)
    found = []
    for values, (begin, end), shift in zip(table.T, bounds, shifts, strict=True):
        power = _last(letters, begin, end)
        if (end - power > _LONGEST_EXPONENT).any(where=power >= 0):
            return None
        ahead = np.where(power >= 0, power, end)
        point = _last(points, begin, ahead)
        form = np.where(point >= 0, np.minimum(ahead - point - 1, EXPONENT - 1), 0) + EXPONENT * (power >= 0)
        form[np.isnan(values)] = NAN
        if shift:
            values = _shifted(values, form, shift)
            for row in np.flatnonzero(np.isnan(values) & (form >= 0)).tolist():
                values[row] = read_single(lines[begin[row] : end[row]].decode("ascii").strip(" "), shift)[0]
        found.append(Alike(values, form.astype(np.int8), ahead - 1))
    return found


def read_single(cell: str, shift: int) -> tuple[float, int]:
    """Read one cell by itself; return its number, NaN where it is none, and its form."""
    if not cell:
        return np.nan, EMPTY
    value = parse_number(cell, shift)
    if value is None:
        return np.nan, UNREAD
    if value != value:
        return value, NAN
    return value, min(printed_decimals(cell), EXPONENT - 1) + (EXPONENT if "e" in cell.lower() else 0)


def _shifted(values: F8, form: NDArray[np.int64], shift: int) -> F8:
    """Return numbers of fixed point times a power of ten, rounded once from their digits; NaN for all others."""
    places = np.clip(form, 0, _TENS.size - 1)
    power = form - shift
    near = np.minimum(np.abs(power), _TENS.size - 1)
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is not exact, and left out below
        whole = np.rint(values * _TENS[places])
        scaled = np.where(power >= 0, whole / _TENS[near], whole * _TENS[near])
    exact = (form >= 0) & (form < _TENS.size) & (np.abs(power) < _TENS.size) & (np.abs(whole) < _MOST_WHOLE)
    return np.where(exact, scaled, np.nan)


def _load(lines: bytes, mark: str, columns: Sequence[int], cells: int) -> F8 | None:
    """Hand lines that are not empty to numpy.loadtxt; None where a cell asked for is no number, or not ASCII."""
    some = None if list(columns) == list(range(cells)) else columns
    if not lines.strip(b"\n"):  # loadtxt warns of what holds no row
        return None
    try:
        return np.loadtxt(lines.decode("ascii").split("\n"), np.float64, None, mark, usecols=some, ndmin=2)
    except ValueError:
        return None


def _begins(ends: I8, column: int) -> I8:
    """Return where the cells of a column begin, from where all cells of each row end."""
    return ends[:, column - 1] + 1 if column else np.concatenate(([0], ends[:-1, -1] + 1))


def _last(places: I8, begin: I8, end: I8) -> I8:
    """Return the last of increasing places that lies within each cell; -1 where none does."""
    if not places.size:
        return np.full(begin.size, -1)
    found = places[np.searchsorted(places, end) - 1]  # before the first one this is the last of all, behind the cell
    return np.where((found >= begin) & (found < end), found, -1)
