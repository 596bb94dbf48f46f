"""Numbers whose thousands are set apart: ``1,234.5``, ``1.234,5``, ``1 234,5``, ``1'234.5``.

They are read where the file itself says which mark is which. ``1,500`` beside ``0.01`` may be either, and is refused:
taken for a decimal mark it would be wrong by a thousand. A column of ``950`` and ``1,000`` has thousands, as fractions
would not end in a zero only there; where every number of a column is like ``1,500``, with no other mark in the file,
the comma is decimal, and this is told.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import zip_longest

from acquisition.errors import FormatError

__all__ = ["doubtful", "ungrouped"]

_REMEDY = "write the numbers without a mark of thousands"
_BLANK = rb"(?: |'|\xc2\xa0|\xa0|\xe2\x80\xaf|\xe2\x80\x99)"
_OTHER_BLANKS = b"'", b"\xa0", b"\xaf", b"\x99"
_SIGN, _EXPONENT = rb"[-+]?", rb"(?:[eE][-+]?\d+)?"
_ANY = rb"[-+]?\d[-+\d.,'eE \xa0\xc2\xe2\x80\xaf\x99]*"  # a run of bytes; what it is is judged afterwards
_APART = re.compile(rb"(?:'|\xa0|\xaf|\x99)\d{3}")  # the last byte of a blank; found without looking at each digit
_BLANK_APART = re.compile(rb" \d{3}(?<=\d \d{3})")
_SPACED = re.compile(_SIGN + rb"[1-9]\d{0,2}(?:" + _BLANK + rb"\d{3})+(?:[.,]\d*)?" + _EXPONENT)
_BLANKS = re.compile(_BLANK)
_DECIMAL = {
    each: re.compile(rb"[%b](?!\d{3}(?!\d))|(?<!\d)0\d*[%b]|\d{4}[%b]" % ((re.escape(each),) * 3))
    for each in (b",", b".")
}
"""A mark that can only be decimal: of other than three digits, or behind a zero or four digits."""
_ONE_GROUP = {each: re.compile(_SIGN + rb"[1-9]\d{0,2}" + re.escape(each) + rb"\d{3}") for each in (b",", b".")}
_WHOLE, _LONG = re.compile(_SIGN + rb"\d{1,3}"), re.compile(_SIGN + rb"\d{4,}")


def ungrouped(path: str, rows: bytes, mark: str) -> Callable[[bytes], bytes] | None:
    """Return what takes the marks of thousands out of rows; None where there are none.

    Parameters
    ----------
    path : str
        For messages.
    rows : bytes
    mark : str
        What separates cells; empty for runs of white space.

    Raises
    ------
    FormatError
        Where a comma or a point may be of thousands as well as of decimals, or is both.

    Examples
    --------
    >>> take = ungrouped("a.csv", b"0.01;1,234.5\\n0.02;999.5\\n", ";")
    >>> take(b"0.01;1,234.5\\n")
    b'0.01;1234.5\\n'
    """
    points, commas = b"." in rows, b"," in rows and (mark != "," or b'"' in rows)
    blanks = bool(mark) and (
        (b" " in rows and _BLANK_APART.search(rows) is not None)
        or (any(each in rows for each in _OTHER_BLANKS) and _APART.search(rows) is not None)
    )
    alone = b"" if points == commas else b"." if points else b","
    group = _group_of_columns(path, rows, mark, alone) if alone and not _DECIMAL[alone].search(rows) else b""
    if not blanks and not group and not (points and commas):
        return None
    cell = _cell(mark)
    found = {each[0].strip(b' "') for each in cell.finditer(rows)}
    group = group or _group(path, found)
    spaced = blanks and any(_SPACED.fullmatch(each) for each in found)
    if not group and not spaced:
        return None
    grouped = re.compile(_thousands(group) + _decimals(group) + b"|" + _SPACED.pattern) if group else _SPACED

    def without(match: re.Match[bytes]) -> bytes:
        plain = match[0].strip(b' "')
        if not grouped.fullmatch(plain):
            return match[0]
        return _BLANKS.sub(b"", plain.replace(group, b"") if group else plain)

    return lambda lines: cell.sub(without, lines)


def doubtful(rows: bytes, mark: str) -> str:
    """Return a number like ``1,500`` whose mark is read as decimal though all like it may be thousands; else nothing.

    Examples
    --------
    >>> doubtful(b"1;1,500\\n2;1,512\\n", ";"), doubtful(b"1;1,500\\n2;0,512\\n", ";")
    ('1,500', '')
    """
    if mark == "," or b"," not in rows or b"." in rows or _DECIMAL[b","].search(rows):
        return ""
    found = next((each[0] for each in _cell(mark).finditer(rows) if b"," in each[0]), b"")
    return _shown(found.strip(b' "'))


def _group_of_columns(path: str, rows: bytes, mark: str, group: bytes) -> bytes:
    """Return the one mark of a table where it sets thousands apart in some column, as whole numbers beside show."""
    if mark == group.decode():
        return b""
    split = [[cell.strip(b' "') for cell in line.split(mark.encode() or None)] for line in rows.splitlines()]
    for column in zip_longest(*split, fillvalue=b""):
        grouped = [cell for cell in column if _ONE_GROUP[group].fullmatch(cell)]
        whole = sum(bool(_WHOLE.fullmatch(cell)) for cell in column)
        if not grouped or not whole or any(_LONG.fullmatch(cell) for cell in column):
            continue
        if any(cell.endswith(b"0") for cell in grouped):
            return group
        raise FormatError(path, f'"{_shown(grouped[0])}" beside whole numbers may be thousands or decimals', _REMEDY)
    return b""


def _cell(mark: str) -> re.Pattern[bytes]:
    """Return what finds whole cells of digits and marks; where commas separate, quoted ones and ones without commas."""
    if mark == ",":
        return re.compile(rb'"' + _ANY + rb'"|(?<![^,\n\r"])[-+]?\d+\.\d*(?![^,\n\r"])')
    edge = re.escape(mark.encode()) if mark else rb"\t "
    body = _ANY if mark else rb"[-+]?\d[\d.,eE+-]*"
    return re.compile(rb"(?<![^" + edge + rb'\n\r])"? *' + body + rb' *"?(?![^' + edge + rb"\n\r])")


def _thousands(group: bytes) -> bytes:
    return _SIGN + rb"[1-9]\d{0,2}(?:" + re.escape(group) + rb"\d{3})+"


def _decimals(group: bytes) -> bytes:
    return rb"(?:" + re.escape(_other(group)) + rb"\d*)?" + _EXPONENT


def _other(group: bytes) -> bytes:
    return b"." if group == b"," else b","


def _group(path: str, cells: set[bytes]) -> bytes:
    """Return which of comma and point sets thousands apart; empty where neither does."""
    sure: dict[bytes, bytes] = {}
    decimal: dict[bytes, bytes] = {}
    unsure: dict[bytes, bytes] = {}
    for group in (b",", b"."):
        both = re.compile(_thousands(group) + re.escape(_other(group)) + rb"\d*" + _EXPONENT)
        many = re.compile(_SIGN + rb"[1-9]\d{0,2}(?:" + re.escape(group) + rb"\d{3}){2,}")
        mark = re.compile(_SIGN + rb"\d+" + re.escape(group) + rb"\d*" + _EXPONENT)
        for each in cells:
            if both.fullmatch(each) or many.fullmatch(each):
                sure[group] = each
            elif _ONE_GROUP[group].fullmatch(each):
                unsure[group] = each
            elif mark.fullmatch(each):
                decimal[group] = each
    for group, shown in sure.items():
        against = sure.get(_other(group)) or decimal.get(group)
        if against:
            message = f'"{_shown(shown)}" and "{_shown(against)}" stand in one table: which mark is of thousands?'
            raise FormatError(path, message, _REMEDY)
        return group
    for group, shown in unsure.items():
        point = decimal.get(_other(group))
        if point and group not in decimal:
            message = f'"{_shown(shown)}" beside "{_shown(point)}" may be thousands or decimals'
            raise FormatError(path, message, _REMEDY)
    return b""


def _shown(cell: bytes) -> str:
    return cell.decode("utf-8", "replace")
