"""One column of cells: numbers of the usual form together, then those of other forms, then the odd ones singly."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from acquisition.block import F8, I8
from acquisition.recordings.tables.fixed_point import Page, read_fixed
from acquisition.recordings.tables.text import parse_number, printed_decimals

__all__ = ["EMPTY", "EXPONENT", "NAN", "UNREAD", "read_column", "read_single"]

EXPONENT = 64
"""Added to the decimals in a form where the number has an exponent."""
NAN, EMPTY, UNREAD = -1, -2, -3

_SAMPLE = 12
_FEWEST = 16  # a form that fewer cells have is not worth a pass over all of them
_MOST_DECIMALS = 15
_MOST_POWER = 22  # powers of ten up to here are exact
_BLANK, _QUOTE, _ZERO, _MINUS, _PLUS, _E = (ord(c) for c in ' "0-+e')
_LOWER = 0x20

I1 = NDArray[np.int8]


def read_column(
    page: Page, begin: I8, end: I8, usual: int, shift: int, points: bytes, values: F8, forms: I1, padded: bool = False
) -> tuple[int, bool, bool]:
    """Read the cells of one column of a page.

    Parameters
    ----------
    page : Page
    begin, end : (n,) int64
        Where each cell begins and ends; an empty one does both in one place.
    usual : int
        The form that the column had so far; -1: not known yet.
    shift : int
        Power of ten to multiply with.
    points : bytes
        What is a decimal mark.
    values : (n,) float64
        Receives the numbers; NaN where there is none.
    forms : (n,) int8
        Receives the form of each cell.
    padded : bool
        Whether a number that ends in a zero was seen already.

    Returns
    -------
    usual : int
    padded : bool
        Whether some number of the usual form ends in a zero behind the point.
    plain : bool
        Whether every cell is a number of the usual form.
    """
    if usual < 0:
        usual = _guess(page, begin, end)
    rest = None
    if usual < EXPONENT:
        _, plain = read_fixed(page, begin, end, usual, shift, points, out=values)
        forms[:] = usual
        if usual and not padded:
            zero = page.raw.take(end - 1, mode="clip") == _ZERO
            padded = bool((zero if plain is None else zero & plain).any())
        if plain is None:
            return usual, padded, True
        rest = np.flatnonzero(~plain)
        begin, end = begin[rest], end[rest]
    rows = np.arange(end.size) if rest is None else rest
    padded |= _read_others(page, rows, begin, end, usual, shift, points, values, forms)
    return usual, padded, False


def _guess(page: Page, begin: I8, end: I8) -> int:
    """Return the form that most cells of a sample have; 0 where none is a number."""
    some = np.linspace(0, end.size - 1, min(end.size, _SAMPLE)).astype(np.int64)
    found = [form for row in some.tolist() if (form := read_single(page, int(begin[row]), int(end[row]), 0)[1]) >= 0]
    return max(sorted(set(found), reverse=True), key=found.count) if found else 0


def _read_others(
    page: Page,
    rows: I8,
    begin: I8,
    end: I8,
    usual: int,
    shift: int,
    points: bytes,
    values: F8,
    forms: I1,
) -> bool:
    """Read cells that are not of the usual fixed form: by form where many share it, else one by one."""
    begin, end = _strip(page, begin, end)
    empty = end <= begin
    values[rows[empty]], forms[rows[empty]] = np.nan, EMPTY
    left = ~empty
    padded = False
    if np.count_nonzero(left) >= _FEWEST:
        left &= ~_read_nan(page, rows, begin, end, values, forms)
        power, stop = _exponents(page, begin, end)
        decimals = _decimals(page, begin, stop, points)
        key = np.where(stop < end, 1, 0) * 10_000_000 + decimals * 10_000 + power + 1000
        for each, count in zip(*np.unique(key[left], return_counts=True), strict=True):
            if count < _FEWEST:
                continue
            rest, exponent = divmod(int(each), 10_000)
            scientific, places = divmod(rest, 1000)
            group = np.flatnonzero(left & (key == each))
            if abs(places - shift - (exponent - 1000)) > _MOST_POWER:
                continue
            value, plain = read_fixed(page, begin[group], stop[group], places, shift + exponent - 1000, points)
            done = group if plain is None else group[plain]
            form = places + EXPONENT * scientific
            values[rows[done]], forms[rows[done]] = value if plain is None else value[plain], form
            left[done] = False
            if form == usual and places:
                padded |= bool((page.raw[stop[done] - 1] == _ZERO).any())
    for at in np.flatnonzero(left).tolist():
        values[rows[at]], forms[rows[at]] = read_single(page, int(begin[at]), int(end[at]), shift)
    return padded


def _strip(page: Page, begin: I8, end: I8) -> tuple[I8, I8]:
    """Leave out a few blanks around cells, and a pair of quotes; those of more are read singly."""
    for character in (_BLANK, _QUOTE):
        for _ in range(8 if character == _BLANK else 1):
            ahead = (page.raw.take(begin, mode="clip") == character) & (begin < end)
            behind = (page.raw.take(end - 1, mode="clip") == character) & (begin < end)
            if character == _QUOTE:
                ahead = behind = ahead & behind & (end - begin > 1)
            if not (ahead.any() or behind.any()):
                break
            begin, end = begin + ahead, end - behind
    return begin, np.maximum(begin, end)


def _read_nan(page: Page, rows: I8, begin: I8, end: I8, values: F8, forms: I1) -> NDArray[np.bool_]:
    three: NDArray[np.bool_] = end - begin == 3
    for offset, letter in enumerate(b"nan"):
        three &= (page.raw.take(begin + offset, mode="clip") | _LOWER) == letter
    values[rows[three]], forms[rows[three]] = np.nan, NAN
    return three


def _exponents(page: Page, begin: I8, end: I8) -> tuple[I8, I8]:
    """Return each cell's power of ten (0 without an exponent) and where its mantissa ends."""
    power, stop = np.zeros(end.size, np.int64), end.copy()
    for length in (1, 2, 3, 4):  # of what follows the E, sign included
        at = end - length - 1
        here = (at > begin) & (stop == end) & ((page.raw.take(at, mode="clip") | _LOWER) == _E)
        if not here.any():
            continue
        sign = page.raw.take(at + 1, mode="clip")
        signed = (sign == _MINUS) | (sign == _PLUS)
        total = np.zeros(end.size, np.int64)
        good = here & ((length > 1) | ~signed)
        for place in range(length):
            digit = page.raw.take(at + 1 + place, mode="clip").astype(np.int64) - _ZERO
            use = ~signed if place == 0 else np.ones(end.size, bool)
            good &= ~use | ((digit >= 0) & (digit <= 9))
            total = np.where(use, total * 10 + digit, total)
        good &= total < 1000
        power = np.where(good, np.where(sign == _MINUS, -total, total), power)
        stop = np.where(good, at, stop)
    return power, stop


def _decimals(page: Page, begin: I8, stop: I8, points: bytes) -> I8:
    """Return how many characters stand behind each mantissa's point; 0 where no point is found."""
    found = np.zeros(stop.size, np.int64)
    for places in range(1, _MOST_DECIMALS):
        at = stop - places - 1
        mark = page.raw.take(at, mode="clip")
        point = (at > begin - 1) & (found == 0)
        point &= np.isin(mark, np.frombuffer(points, np.uint8))
        found[point] = places
    return found


def read_single(page: Page, begin: int, end: int, shift: int) -> tuple[float, int]:
    """Read one cell by itself; return its number, NaN where it is none, and its form."""
    cell = page.raw[begin:end].tobytes().decode("ascii", "replace").strip(" ")
    if len(cell) > 1 and cell[0] == cell[-1] == '"':
        cell = cell[1:-1].strip(" ")
    if not cell:
        return math.nan, EMPTY
    value = parse_number(cell, shift)
    if value is None:
        return math.nan, UNREAD
    if math.isnan(value):
        return value, NAN
    return value, min(printed_decimals(cell), EXPONENT - 1) + (EXPONENT if "e" in cell.lower() else 0)
