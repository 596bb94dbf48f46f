"""Lines alike: those of a page whose cells are all numbers, read together by numpy.

What numpy reads as a number and a recording does not, and how many decimals each cell prints, is judged here; a page
that is not regular is refused, and :mod:`acquisition.recordings.tables.table` halves it.

Columns of fixed point are read as whole numbers, digit by digit from their ends, all rows at once: 12,000 rows of three
columns take 0.5 ms so, :func:`numpy.fromstring` 0.75 ms once their points are taken out, and 6.5 ms as decimal
fractions (pandas 2.3 ms on the same cores). One division then puts the point back, and whatever power of ten makes SI
units, rounded once, as ``float()`` rounds. Numbers with exponents are for :func:`numpy.loadtxt`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.block import F8, I8, U8
from acquisition.recordings.tables.text import parse_number, printed_decimals

__all__ = ["EMPTY", "EXPONENT", "I1", "NAN", "UNREAD", "Alike", "read_fixed", "read_mixed", "read_single", "unified"]

EXPONENT = 64
"""Added to the decimals in a form where the number has an exponent."""
NAN, EMPTY, UNREAD = -1, -2, -3

I1 = NDArray[np.int8]

_MOST_DIGITS = 15  # whole numbers of so many and powers of ten up to 10^22 are exact in binary, so that their
_MOST_POWER = 22  # quotient is rounded once
_LONGEST_EXPONENT = len("e-99")
_QUOTED_COMMA = re.compile(rb'"([-+]?\d*),(\d+(?:[eE][-+]?\d+)?)"')  # a decimal comma where commas separate
_NEWLINE, _RETURN, _BLANK, _PLUS, _MINUS, _POINT, _ZERO, _E, _LOWER = (*(ord(c) for c in "\n\r +-.0e"), 0x20)


class Alike(NamedTuple):
    """One column of some rows: its numbers, their forms (one for all, or each its own), where its cells end."""

    values: F8
    form: I1 | int
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


def read_fixed(
    lines: bytes, mark: str, columns: Sequence[int], width: int | None, shifts: Sequence[int]
) -> list[Alike] | None:
    """Read lines of fixed point, each column with as many decimals throughout; None where they are anything else.

    Parameters
    ----------
    lines : bytes
    mark : str
        What separates cells, one character.
    columns, width, shifts
        See :func:`acquisition.recordings.tables.table.read_table`.

    Notes
    -----
    What is left of such lines without digits and signs is the same for each: separators, and a point a cell.
    """
    skeleton = lines.translate(None, b"0123456789+-")
    first = skeleton[: skeleton.find(b"\n") + 1]
    ended = lines.endswith(b"\n") and mark not in "+-."
    if not ended or skeleton != first * (len(skeleton) // len(first)):
        return None
    cells = lines[: lines.find(b"\n")].decode("ascii", "replace").removesuffix("\r").split(mark)
    if width not in (None, len(cells)) or max(columns) >= len(cells):
        return None
    raw = np.frombuffer(lines, np.uint8)
    ends = np.flatnonzero((raw == ord(mark)) | (raw == _NEWLINE)).reshape(-1, len(cells))
    begins = _begins(ends, 0), *(ends[:, column] + 1 for column in range(len(cells) - 1))
    if first.endswith(b"\r\n"):
        ends[:, -1] -= 1
        if (raw[ends[:, -1]] != _RETURN).any():
            return None
    signed = b"-" in lines or b"+" in lines
    found = []
    for column, shift in zip(columns, shifts, strict=True):
        cell, begin, end = cells[column], begins[column], ends[:, column]
        places = printed_decimals(cell)
        power = places - shift
        if parse_number(cell) is None or ("." in cell) != (places > 0) or abs(power) > _MOST_POWER:
            return None
        negative = None
        if signed:
            sign = raw[begin]
            negative = sign == _MINUS
            begin = begin + (negative | (sign == _PLUS))
        number = _whole(raw, begin, end, places)
        if number is None:
            return None
        values: F8 = number / 10.0**power if power >= 0 else number * 10.0**-power
        if negative is not None:
            np.negative(values, out=values, where=negative)
        found.append(Alike(values, places, end - 1))
    return found


def read_mixed(
    lines: bytes, mark: str, columns: Sequence[int], width: int | None, shifts: Sequence[int]
) -> list[Alike] | None:
    """Read lines of as many cells each, those asked for numbers of any form; None where they are anything else.

    The lines are :func:`unified`; for the arguments see :func:`read_fixed`.
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
        if shift:  # read again, to be rounded once
            places = zip(begin.tolist(), end.tolist(), strict=True)
            values = np.array([read_single(lines[at:stop].decode("ascii").strip(" "), shift)[0] for at, stop in places])
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


def _whole(raw: U8, begin: I8, end: I8, places: int) -> F8 | None:
    """Return the digits of cells, read as whole numbers; None where one holds anything else, or too many of them.

    Parameters
    ----------
    raw : (bytes,) uint8
    begin, end : (n,) int64
        Of each cell, without its sign.
    places : int
        Decimals behind a point in every cell; 0: there is none.
    """
    widths = end - begin
    least, most = int(widths.min()), int(widths.max())
    pointed = places > 0
    if least < 1 + pointed + places or most > _MOST_DIGITS + pointed:
        return None
    if pointed and (raw.take(end - places - 1) != _POINT).any():
        return None
    number = np.zeros(end.size)
    for digit in range(most - pointed):
        back = digit + 1 + (pointed and digit >= places)  # bytes from the cell's end, the point among them
        byte = raw.take(end - back)
        byte -= _ZERO
        if back > least:
            byte *= widths >= back
        if byte.max() > 9:  # what lies below "0" has gone beyond all digits
            return None
        number += byte * np.float64(10.0**digit)
    return number


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
