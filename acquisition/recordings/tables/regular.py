"""Read pages of regular lines, whose wanted cells are all numbers, by one call of :func:`numpy.loadtxt`.

This module rejects text that numpy accepts as a number but that is not valid in a recording, and counts the printed
decimals of each cell. It returns None for a page that is not regular; then
:mod:`acquisition.recordings.tables.table` reads the rows one by one.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.block import F8, I8
from acquisition.recordings.tables.text import parse_number, printed_decimals

__all__ = ["EMPTY", "EXPONENT", "I1", "NAN", "UNREAD", "RegularColumn", "read_regular", "read_single", "unified"]

EXPONENT = 64
"""Constant that is added to the number of decimals in the form of a number with an exponent."""
NAN, EMPTY, UNREAD = -1, -2, -3

I1 = NDArray[np.int8]

# Whole numbers below 1e15 and powers of ten up to 10^22 are exact in binary, so their quotient is rounded only once.
_MOST_WHOLE = 1e15
_TENS = np.array([float(f"1e{power}") for power in range(23)])
_LONGEST_EXPONENT = len("e-99")
_QUOTED_COMMA = re.compile(rb'"([-+]?\d*),(\d+(?:[eE][-+]?\d+)?)"')  # decimal comma in comma-separated cells
_NEWLINE, _BLANK, _POINT, _E, _LOWER = (*(ord(c) for c in "\n .e"), 0x20)


class RegularColumn(NamedTuple):
    """One column of a page: its numbers, their forms, and the positions of their last digits."""

    values: F8
    form: I1
    last: I8
    """Byte position of the last digit of each number, or of its mantissa if it has an exponent."""


def unified(page: bytes, delimiter: str) -> bytes:
    """Normalise a page: LF as line end, no quotes, one tab for a run of white space, points for decimal commas."""
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
) -> list[RegularColumn] | None:
    """Read lines that have equally many cells, and numbers in all wanted columns; return None for any other lines.

    Parameters
    ----------
    lines : bytes
        As :func:`unified` returns them.
    mark : str
        The separator of cells, one character.
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
    # loadtxt strips all white space. Here all but blanks are damage: a number next to it may have lost digits.
    if np.count_nonzero(raw < _BLANK) != (ends.size if ord(mark) < _BLANK else rows):
        return None
    if width is not None and (cells < width or (np.diff(ends[:, width - 1 :]) != 1).any()):
        return None
    bounds = [(_begins(ends, column), ends[:, column]) for column in columns]
    if any(((end == begin) | (raw[end - 1] == _BLANK)).any() for begin, end in bounds):
        return None
    table = _load(lines, mark, columns, cells)
    if table is None or np.isinf(table).any():  # the word "inf", or a number that overflows
        return None
    points, letters = np.flatnonzero(raw == _POINT), np.flatnonzero((raw | _LOWER) == _E)
    read = []
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
        read.append(RegularColumn(values, form.astype(np.int8), ahead - 1))
    return read


def read_single(cell: str, shift: int) -> tuple[float, int]:
    """Read one cell; return its number (NaN if it is not a number) and its form."""
    if not cell:
        return np.nan, EMPTY
    value = parse_number(cell, shift)
    if value is None:
        return np.nan, UNREAD
    if value != value:
        return value, NAN
    return value, min(printed_decimals(cell), EXPONENT - 1) + (EXPONENT if "e" in cell.lower() else 0)


def _shifted(values: F8, form: NDArray[np.int64], shift: int) -> F8:
    """Return fixed-point numbers multiplied by a power of ten and rounded only once; NaN for other forms."""
    places = np.clip(form, 0, _TENS.size - 1)
    power = form - shift
    near = np.minimum(np.abs(power), _TENS.size - 1)
    with np.errstate(over="ignore", invalid="ignore"):  # numbers that overflow are not exact and become NaN below
        whole = np.rint(values * _TENS[places])
        scaled = np.where(power >= 0, whole / _TENS[near], whole * _TENS[near])
    exact = (form >= 0) & (form < _TENS.size) & (np.abs(power) < _TENS.size) & (np.abs(whole) < _MOST_WHOLE)
    return np.where(exact, scaled, np.nan)


def _load(lines: bytes, mark: str, columns: Sequence[int], cells: int) -> F8 | None:
    """Read lines with numpy.loadtxt; return None if all are empty or a wanted cell is not a number in ASCII."""
    some = None if list(columns) == list(range(cells)) else columns
    if not lines.strip(b"\n"):  # loadtxt warns if there are no rows
        return None
    try:
        return np.loadtxt(lines.decode("ascii").split("\n"), np.float64, None, mark, usecols=some, ndmin=2)
    except ValueError:
        return None


def _begins(ends: I8, column: int) -> I8:
    """Return the positions of the first bytes of a column's cells, given the ends of all cells."""
    return ends[:, column - 1] + 1 if column else np.concatenate(([0], ends[:-1, -1] + 1))


def _last(places: I8, begin: I8, end: I8) -> I8:
    """Return, for each cell, the last of the increasing ``places`` that lies inside it; -1 if there is none."""
    if not places.size:
        return np.full(begin.size, -1)
    last = places[np.searchsorted(places, end) - 1]  # index -1 gives the last place of all, which lies after the cell
    return np.where((last >= begin) & (last < end), last, -1)
