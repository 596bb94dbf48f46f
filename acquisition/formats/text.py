"""Text that holds columns of numbers: decoding, lines, and a table of cells with what could not be read.

Two readers give the same numbers. The fast one takes fixed-point columns as integers, all rows at once, and
declines at the first thing out of the ordinary. The slow one goes row by row and says which rows it could
not read.
"""

from __future__ import annotations

import codecs
import math
import re
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from acquisition.block import F8, I8

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
_DOT, _MINUS, _NAN, _TAB, _NEWLINE, _ZERO = (ord(c) for c in ".-N\t\n0")
_MAX_DIGITS = (
    15  # integers of 15 digits and powers of ten up to 22 are exact, so their quotient rounds as float() does
)
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
    if fast and delimiter and (found := _fixed_point(body, columns, delimiter)) is not None:
        values, decimals = found
        rows = len(values)
        return Table(values, first_line + np.arange(rows), np.zeros(rows, bool), decimals)
    return _row_by_row(body, columns, delimiter, first_line)


def _fixed_point(body: str, columns: int, delimiter: str) -> tuple[F8, tuple[int, ...]] | None:
    """Read columns of fixed point (or NaN) at once; None where anything is out of the ordinary."""
    body = body.rstrip("\n")
    if not body or not body.isascii() or (delimiter != "\t" and "\t" in body) or "\n\n" in body:
        return None
    if delimiter != "\t":
        body = body.replace(delimiter, "\t")
    if "," in body and "." not in body:
        body = body.replace(",", ".")
    raw = np.frombuffer(f"{body}\n".encode("ascii"), np.uint8)
    ends = np.flatnonzero(raw <= _NEWLINE)
    first_row = body[: body.find("\n") if "\n" in body else None].split("\t")
    second_row = body[len("\t".join(first_row)) + 1 :].split("\n", 1)[0].split("\t")
    if ends.size % columns or len(first_row) != columns:
        return None
    at_end = raw[ends].reshape(-1, columns)
    if not ((at_end[:, -1] == _NEWLINE).all() and (at_end[:, :-1] == _TAB).all()):
        return None
    # NaN may stand in the first row (a velocity has no first value): the second then tells the decimals.
    decimals = tuple(
        max(_decimals(a), _decimals(b))
        for a, b in zip(first_row, [*second_row, *[""] * columns], strict=False)
    )
    if min(decimals) < 1 or len(decimals) != columns:
        return None
    values = _cells_to_numbers(raw, ends, np.array(decimals)[np.arange(ends.size) % columns])
    return None if values is None else (values.reshape(-1, columns), decimals)


def _cells_to_numbers(raw: NDArray[np.uint8], ends: I8, decimals: I8) -> F8 | None:
    """Turn cells that end before ``ends`` into numbers; None unless each is ``-?digits.decimals`` or NaN."""
    starts = np.concatenate(([0], ends[:-1] + 1))
    lead = raw[starts]
    negative, nan = lead == _MINUS, lead == _NAN
    digits = ends - starts - 1 - negative
    fits = (digits > decimals) & (digits <= _MAX_DIGITS) & (raw[ends - decimals - 1] == _DOT)
    is_digit = (raw - np.uint8(_ZERO)) < 10  # unsigned: what is below "0" wraps to above 9
    other = raw.size - int(np.count_nonzero(is_digit)) - ends.size
    # One point, the signs and the letters of NaN account for every byte that is no digit.
    if other != np.count_nonzero(~nan) + np.count_nonzero(negative) + 3 * np.count_nonzero(nan):
        return None
    if nan.any():
        where = starts[nan]
        spelled = (ends[nan] - where == 3) & (raw[where + 1] == ord("a")) & (raw[where + 2] == _NAN)
        if not spelled.all():
            return None
    if not (fits | nan).all():
        return None
    # Place by place from the right, for all cells at once; where a cell is shorter, its digit counts as zero.
    width = int(digits[~nan].max(initial=0))
    padded = np.concatenate((np.zeros(width + 1, np.uint8), np.where(is_digit, raw - np.uint8(_ZERO), 0)))
    value = np.zeros(ends.size, np.int64)
    least_digits, least_decimals = digits[~nan].min(initial=0), decimals.min(initial=0)
    for place in range(width):
        at = ends + (width - place)
        if place >= least_decimals:
            at -= place >= decimals  # a point is stepped over
        digit = padded[at].astype(np.int64)
        if place >= least_digits:
            digit *= place < digits
        value += digit * 10**place
    numbers: F8 = value / 10.0**decimals
    numbers[negative] *= -1.0
    numbers[nan] = np.nan
    return numbers


def _row_by_row(body: str, columns: int, delimiter: str, first_line: int) -> Table:
    values: list[list[float]] = []
    decimals: list[list[int]] = []
    lines: list[int] = []
    bad: list[bool] = []
    first_cells: list[str] = []
    for number, text in enumerate(body.split("\n"), first_line):
        if not text.strip(" \t"):
            continue
        cells = split_cells(text, delimiter)
        numbers = [parse_number(cell) for cell in cells]
        lines.append(number)
        bad.append(len(cells) != columns or None in numbers)
        first_cells.append(cells[0] if cells else "")
        padded = [*(math.nan if x is None else x for x in numbers), *[math.nan] * columns]
        values.append(padded[:columns])
        decimals.append([*(_decimals(cell) for cell in cells), *[-1] * columns][:columns])
    table = np.array(values, float).reshape(-1, columns)
    printed = np.array(decimals, np.int64).reshape(-1, columns)
    is_bad = np.array(bad, bool)
    usual = tuple(_usual(printed[~is_bad, c]) for c in range(columns))
    is_bad |= _cut(printed, is_bad, usual, ended=body.endswith("\n"))
    unread = {int(row): first_cells[row] for row in np.flatnonzero(is_bad)}
    return Table(table, np.array(lines, np.int64), is_bad, usual, unread)


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
