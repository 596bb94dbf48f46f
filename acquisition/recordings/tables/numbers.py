"""The grammar of numbers: a cell of text as a number, its value as printed, and how many decimals are printed.

1. A number has digits of one script, at most one point or comma, and perhaps an exponent after E, D or Q.
2. :func:`plain` gives signs, digits and exponents of other scripts and languages their ASCII form, for a whole text.
3. ``(12.3)`` and ``12.3-`` of accounting are negative.
4. Words for an overload or a lost value, dashes, and numbers from 9e36 on, which instruments send for an overload, are
   missing samples. All other text is not a number.
5. Thousands separators are refused; a mark that may be one needs evidence that it is a decimal mark.
"""

from __future__ import annotations

import contextlib
import csv
import math
import re
import unicodedata
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from acquisition.block import B1, F8
from acquisition.recordings.tables.vocabulary import LOST
from acquisition.units import measure_of

I1 = NDArray[np.int8]
NAN_CELL, EMPTY_CELL, UNREAD_CELL = -1, -2, -3
"""In place of a number of decimals: NaN or another word for a missing number, an empty cell, any other text."""
EXPONENT = 64
"""Added to the number of decimals of the mantissa if a number has an exponent."""

_CELL = re.compile(r"([+-]?(?:\d+[.,]?(\d*)|[.,](\d+)))(?:[eEdDqQ]([+-]?\d{1,3}))?", re.ASCII)
_TO_PYTHON = str.maketrans(",dDqQ", ".eeee")
_ACCOUNTED = re.compile(r"\((\d[\d.,]*)\)|(\d[\d.,]*)-", re.ASCII)
_NAN = re.compile(r"[+-]?nan", re.IGNORECASE)
_LOST = re.compile(r"[-+±>]?∞|[-–—−]+|…|\*+|\?+|\.{2,}")
_QUANTITY = re.compile(r"([-+]?[\d.,]+(?:[eE][-+]?\d{1,2})?)[ \xa0]?([^\W\d_][^\s\d]*|°)")
_OVERLOAD = 9e36
_MINUS = re.compile(
    r"(?:(?<![^\W_])|(?<=\d[eE^]))[\u2212\u2013\ufe63\uff0d](?=[.,\u066b]?[\d∞])|(?<=\d)[\u2212\u2013](?=[\s;]|$)"
)
_POWER = re.compile(r"(?<=\d)[ \xa0]?(?:[×·][ \xa0]?10\^?|[اأ]س)(?=[-+\u2212\d])")
_SPACE = re.compile(r"(?<!\d)[\xa0\u2007\u2009\u202f]|[\xa0\u2007\u2009\u202f](?!\d)")
_MARKS = {0x60C: ",", 0x61B: ";", 0xFF0E: ".", 0xFF0C: ",", 0xFF1B: ";"}
_OF_NUMBERS = "\u2212\u2013\ufe63\uff0d\xa0\u2007\u2009\u202f\u066b\u066c\u200b\u200e\u200f\u061c×·"
_ALWAYS = {0x66B: ".", 0x66C: "'", **dict.fromkeys((0x200B, 0x200E, 0x200F, 0x61C))}
THOUSANDS = re.compile(rb"[-+]?[1-9]\d{0,2}((?:[,. ']|\xc2?\xa0|\xe2\x80[\xaf\x99\x89])\d{3})+([.,]\d*)?")
_LONGEST = 64  # bytes of a cell that are examined; longer cells are rare and are read one by one
_DIGIT, _SIGN, _MARK, _E, _OTHER = 1, 2, 3, 4, 5
_KINDS = np.full(256, _OTHER, np.uint8)
for _kind, _characters in ((0, b"\0"), (_DIGIT, b"0123456789"), (_SIGN, b"+-"), (_MARK, b".,"), (_E, b"eE")):
    _KINDS[list(_characters)] = _kind
_DAMAGE = bytes.maketrans(b"\0\x0b\x0c\x1c\x1d\x1e\x1f", b"?" * 7)
"""Control characters that numpy or ``split`` would ignore: a number next to one may have lost digits."""


def plain(text: str) -> str:
    """Return a text whose numbers have ASCII digits, signs, exponents and blanks, in whichever script they are."""
    if text.isascii():
        return text
    others = [each for each in set(text) if each > "\x7f"]
    digits = {ord(each): str(unicodedata.decimal(each)) for each in others if each.isdecimal()}
    if not digits and not any(each in _OF_NUMBERS for each in others):  # the usual case: letters of headings
        return text
    text = text.translate({**(_MARKS if digits else {}), **_ALWAYS, **digits})
    return _MINUS.sub("-", _POWER.sub("e", _SPACE.sub(" ", text)))


def cell(text: str) -> tuple[float, int]:
    """Return the number in a cell, with a point or a comma, and its printed decimals; NaN and a code if there is none.

    This is stricter than ``float()``: it rejects ``1_000``, ``inf``, digits of other scripts, and overflow.
    """
    if not text:
        return math.nan, EMPTY_CELL
    match = _CELL.fullmatch(text)
    if match is None and (accounted := _ACCOUNTED.fullmatch(text)):
        text = f"-{accounted[1] or accounted[2]}"
        match = _CELL.fullmatch(text)
    if match is None:
        return math.nan, NAN_CELL if _NAN.fullmatch(text) or is_lost(text) else UNREAD_CELL
    value = float(text.translate(_TO_PYTHON))
    if not abs(value) < _OVERLOAD:
        return math.nan, NAN_CELL
    decimals = min(len(match[2] or match[3] or ""), EXPONENT - 1)
    return value, decimals + (EXPONENT if match[4] else 0)


def is_lost(text: str) -> bool:
    """Return whether a cell is a word or sign that stands in place of a number."""
    return "".join(text.lower().split()).lstrip("+-><") in LOST or bool(_LOST.fullmatch(text))


def quantity(text: str) -> tuple[str, str] | None:
    """Return the number and the word of a cell that has both, as ``26.9 cm``; None for any other text."""
    match = _QUANTITY.fullmatch(text)
    return (match[1], match[2]) if match is not None and parse_number(match[1]) is not None else None


def is_quantity(text: str) -> bool:
    """Return whether a cell has a number and a unit that a channel may have."""
    pair = quantity(text)
    return pair is not None and measure_of(pair[1]) is not None


def parse_number(text: str) -> float | None:
    """Return the number in a cell, which may be NaN; None for any other text."""
    value, decimals = cell(text)
    return None if decimals < NAN_CELL or (decimals == NAN_CELL and is_lost(text)) else value


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
        values[row], decimals[row] = cell(cells[row].decode("utf-8", "replace"))
    beyond = np.abs(values) >= _OVERLOAD
    values[beyond], decimals[beyond] = np.nan, NAN_CELL
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
