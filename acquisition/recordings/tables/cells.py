"""Cells of rows of text as numbers: their values as printed, and how many decimals are printed."""

from __future__ import annotations

import contextlib
import csv
import math
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from acquisition.block import B1, F8

I1 = NDArray[np.int8]
NAN_CELL, EMPTY_CELL, UNREAD_CELL = -1, -2, -3
"""In place of a number of decimals: the word NaN, an empty cell, a cell that is not a number."""
EXPONENT = 64
"""Added to the number of decimals of the mantissa if a number has an exponent."""

_CELL = re.compile(r"([+-]?(?:\d+[.,]?(\d*)|[.,](\d+)))(?:[eE]([+-]?\d{1,3}))?", re.ASCII)
_LONGEST = 64  # bytes of a cell that are examined; longer cells are rare and are read one by one
_DIGIT, _SIGN, _MARK, _E, _OTHER = 1, 2, 3, 4, 5
_KINDS = np.full(256, _OTHER, np.uint8)
for _kind, _characters in ((0, b"\0"), (_DIGIT, b"0123456789"), (_SIGN, b"+-"), (_MARK, b".,"), (_E, b"eE")):
    _KINDS[list(_characters)] = _kind
_DAMAGE = bytes.maketrans(b"\0\x0b\x0c\x1c\x1d\x1e\x1f", b"?" * 7)
"""Control characters that numpy or ``split`` would ignore: a number next to one may have lost digits."""
CLOCK = re.compile(
    r"'?(?P<date>\d{1,4}[-./]\d{1,2}[-./]\d{1,4}[T ,]*)?"
    r"(?:(?P<h>\d{1,2}):(?P<m>\d{1,2}):(?P<s>\d{1,2})(?:[.,](?P<part>\d{1,9})|::?(?P<ms>\d{1,3}))?"
    r"|(?P<h2>\d{1,2}):(?P<m2>\d\d)|(?P<m3>\d{1,2}):(?P<s3>\d\d)[.,](?P<part3>\d{1,9}))"
    r"\s*(?P<half>[aApP]\.?[mM]\.?)?(?:Z|[+-]\d\d:?\d\d)?",
    re.ASCII,
)


def cell(text: str) -> tuple[float, int]:
    """Return the number in a cell, with a point or a comma, and its printed decimals; NaN and a code if there is none.

    This is stricter than ``float()``: it rejects ``1_000``, ``inf``, digits of other scripts, and overflow.
    """
    if not text:
        return math.nan, EMPTY_CELL
    match = _CELL.fullmatch(text)
    if match is None:
        return math.nan, NAN_CELL if text.lower() in ("nan", "-nan", "+nan") else UNREAD_CELL
    value = float(text.replace(",", "."))
    if not math.isfinite(value):
        return math.nan, UNREAD_CELL
    decimals = min(len(match[2] or match[3] or ""), EXPONENT - 1)
    return value, decimals + (EXPONENT if match[4] else 0)


def clock_s(cell: str) -> tuple[str, float, int] | None:
    """Return the printed date, the second of the day and the number of decimals; None for any other text."""
    match = CLOCK.fullmatch(cell)
    if match is None:
        return None
    hour = int(match["h"] or match["h2"] or 0)
    hour = hour % 12 + 12 * (match["half"][0] in "pP") if match["half"] else hour
    part = f"{match['ms']:0>3}" if match["ms"] else match["part"] or match["part3"] or ""
    decimals = len(part)
    seconds = float(f"{match['s'] or match['s3'] or 0}.{part}")
    at = hour * 3600 + int(match["m"] or match["m2"] or match["m3"]) * 60 + seconds
    return (match["date"] or "").strip(" ,T"), round(at, decimals), decimals


def clock_times(cells: Sequence[bytes]) -> tuple[F8, I1, B1]:
    """Return times of day in seconds, the decimals of each, and a mask without commas, as :func:`read_cells` does."""
    values, decimals = np.full(len(cells), np.nan), np.full(len(cells), UNREAD_CELL, np.int8)
    for row, each in enumerate(cells):
        if (time := clock_s(each.strip(b'"').decode("latin-1"))) is not None:
            _, values[row], decimals[row] = time
    return values, decimals, np.zeros(values.size, bool)


def parse_number(text: str) -> float | None:
    """Return the number in a cell, which may be NaN; None for any other text."""
    value, decimals = cell(text)
    return None if decimals in (EMPTY_CELL, UNREAD_CELL) else value


def split_page(page: bytes, delimiter: str) -> list[list[bytes]]:
    """Split whole lines into cells without blanks and quotes; without a delimiter, runs of white space separate them.

    A blank line gives an empty list.
    """
    page = page.translate(_DAMAGE)
    lines = page.split(b"\n")
    if not lines[-1]:
        lines.pop()
    if not delimiter:
        return [line.split() if b'"' not in line else _quoted(line.replace(b"\t", b" "), " ") for line in lines]
    mark = delimiter.encode()
    if b'"' not in page and b" " not in page and b"\t" not in page.replace(mark, b""):
        return [line.split(mark) if line.strip(b"\t") else [] for line in lines]
    return [
        ([each.strip(b" ") for each in line.split(mark)] if b'"' not in line else _quoted(line, delimiter))
        if line.strip(b" \t")
        else []
        for line in lines
    ]


def _quoted(line: bytes, delimiter: str) -> list[bytes]:
    text = line.decode("latin-1")
    try:
        cells = next(csv.reader([text], delimiter=delimiter, skipinitialspace=True, strict=True), [])
    except csv.Error:  # a quote without its partner: the cell is damaged
        cells = text.split(delimiter)
    return [each.strip(" ").encode("latin-1") for each in cells if each or delimiter != " "]


def read_cells(cells: Sequence[bytes]) -> tuple[F8, I1, B1]:
    """Return the values and decimals of the cells of a column, as :func:`cell` gives them, and which have a comma."""
    longest = max(map(len, cells))
    text = np.array(cells if longest <= _LONGEST else [each[: _LONGEST + 1] for each in cells], np.bytes_)
    raw = text.view(np.uint8).reshape(text.size, -1)
    kinds = _KINDS[raw]
    lengths, marks = np.count_nonzero(kinds, axis=1), kinds == _MARK
    marked, digits = np.count_nonzero(marks, axis=1), np.count_nonzero(kinds == _DIGIT, axis=1)
    fixed = (digits + marked + (kinds[:, 0] == _SIGN) == lengths) & (digits > 0) & (marked <= 1)
    fixed &= lengths <= _LONGEST
    values = np.full(text.size, np.nan)
    places = np.where(marked == 1, lengths - 1 - marks.argmax(axis=1), 0)
    decimals = np.where(lengths == 0, EMPTY_CELL, np.minimum(places, EXPONENT - 1)).astype(np.int8)
    comma = raw == ord(",")
    raw[comma] = ord(".")
    values[fixed] = text[fixed].astype(np.float64)
    unfixed = ~fixed & (lengths > 0)
    # A mantissa with a mark, and an exponent of up to two digits.
    letters = kinds == _E
    exponent = lengths - letters.argmax(axis=1)  # the length of it with its letter
    scientific = unfixed & (letters.sum(axis=1) == 1) & (marked == 1) & (places >= exponent) & (exponent <= len("e-99"))
    if (scientific == unfixed).all() and not (kinds[unfixed] == _OTHER).any():
        with contextlib.suppress(ValueError):
            values[unfixed] = text[unfixed].astype(np.float64)
            decimals[unfixed] = np.minimum(places - exponent, EXPONENT - 1)[unfixed] + EXPONENT
            unfixed &= ~np.isfinite(values)
    for row in np.flatnonzero(unfixed).tolist():
        values[row], decimals[row] = cell(cells[row].decode("latin-1"))
    return values, decimals, comma.any(axis=1)


def scaled(values: F8, decimals: I1 | None, power: int) -> F8:
    """Return numbers times ten to a power, rounded only once if they are printed without exponents.

    A number printed with d decimals is a whole number over 10**d, so the product is a whole number over
    10**(d - power), and is rounded to that.
    """
    result: F8 = values * 10.0**power if power >= 0 else values / 10.0**-power
    if decimals is None or not power or decimals.max(initial=0) >= EXPONENT:
        return result
    return np.round(result, int(decimals.max(initial=0)) - power)


def usual_decimals(decimals: I1) -> tuple[int, bool]:
    """Return the most frequent number of decimals (of two, the greater), and whether numbers usually have exponents."""
    counts = np.bincount(decimals[decimals >= 0], minlength=2 * EXPONENT)
    exponents = bool(counts[EXPONENT:].sum() > counts[:EXPONENT].sum())
    half = counts[EXPONENT:] if exponents else counts[:EXPONENT]
    return (int(half.size - 1 - half[::-1].argmax()) if half.any() else 0), exponents


def is_cut(values: F8, decimals: I1) -> bool:
    """Return whether the last number of a column, at the end of a text without a line end, may have lost digits.

    It is complete if it has the decimals that its column always prints. In a column of varying or no decimals nothing
    shows that it is complete. Decimals vary if trailing zeros are not printed: several numbers are then shorter, and
    none of the usual length ends in zero.
    """
    if decimals[-1] < 0 or decimals.size == 1:
        return False
    usual, exponents = usual_decimals(decimals)
    form = usual + EXPONENT * exponents
    numbers = decimals[(decimals >= 0) & (exponents | (decimals < EXPONENT))]
    others = int(np.count_nonzero(numbers != form))
    if usual == 0 or others > 0.1 * numbers.size:
        return True
    if others >= 2:
        alike = np.abs(values[decimals == form])
        with np.errstate(divide="ignore"):
            size = np.where(alike > 0, np.floor(np.log10(alike)), 0.0) if exponents else 0.0
        if not (np.rint(alike / 10.0**size * 10.0**usual) % 10 == 0).any():
            return True
    return int(decimals[-1]) != form
