"""Refuse thousands separators (``1,234.5``, ``1 234``): reading them as decimal marks gives errors of a factor 1000."""

from __future__ import annotations

import re
from itertools import zip_longest

from acquisition.errors import FormatError

__all__ = ["refuse_thousands"]

_REMEDY = "export the numbers without thousands separators"
_BLANK = rb"(?: |'|\xc2\xa0|\xa0|\xe2\x80\xaf|\xe2\x80\x99)"
_GROUP = rb"[-+]?[1-9]\d{0,2}"
_END = rb"(?:[eE][-+]?\d+)?"
_SURE = re.compile(
    _GROUP
    + rb"(?:(?:,\d{3})+\.\d*|(?:\.\d{3})+,\d*|(?:,\d{3}){2,}|(?:\.\d{3}){2,}|(?:%b\d{3})+(?:[.,]\d*)?)" % _BLANK
    + _END
)
_ONE = {each: re.compile(_GROUP + re.escape(each) + rb"\d{3}") for each in (b",", b".")}
_DECIMAL = {
    each: re.compile(rb"[%b](?!\d{3}(?!\d))|(?<!\d)0\d*[%b]|\d{4}[%b]" % ((re.escape(each),) * 3))
    for each in (b",", b".")
}
"""Patterns of a mark that can only be decimal: not followed by exactly three digits, or after a zero or four digits."""
_WHOLE, _LONG = re.compile(rb"[-+]?\d{1,3}"), re.compile(rb"[-+]?\d{4,}")
_BLANKS = re.compile(rb"(?:\d[ ']|[\xa0\xaf\x99])\d{3}")


def refuse_thousands(path: str, rows: bytes, mark: str) -> str:
    """Refuse rows whose numbers have, or may have, a thousands separator.

    Parameters
    ----------
    path : str
        For messages.
    rows : bytes
    mark : str
        The separator of cells; empty for runs of white space.

    Returns
    -------
    str
        A number like ``1,500`` if all numbers with a comma look like it and no number has a point. The comma is then
        read as a decimal mark, although nothing in the file confirms this. Otherwise an empty text.

    Raises
    ------
    FormatError
        If a number has a thousands separator, or a comma or point may be a thousands separator or a decimal mark.

    Examples
    --------
    >>> refuse_thousands("a.csv", b"1;1,500\\n2;1,512\\n", ";"), refuse_thousands("a.csv", b"1;1,500\\n2;0,512\\n", ";")
    ('1,500', '')
    """
    points, commas = b"." in rows, b"," in rows and (mark != "," or b'"' in rows)
    blanks = bool(mark) and _BLANKS.search(rows) is not None
    # If commas separate the cells, only commas within quotes belong to numbers.
    marked = {b".": rows, b",": b"\n".join(re.findall(rb'"[^"]*"', rows)) if mark == "," else rows}
    alone = [
        each for each, there in ((b".", points), (b",", commas)) if there and not _DECIMAL[each].search(marked[each])
    ]
    if not alone and not blanks and not (points and commas):
        return ""
    lines = rows.splitlines()
    if mark == ",":
        split = [[cell.strip(b' "') for cell in re.findall(rb'"[^"]*"|[^,]+', line)] for line in lines]
    else:
        split = [[cell.strip(b' "') for cell in line.split(mark.encode() or None)] for line in lines]
    doubtful = b""
    for column in zip_longest(*split, fillvalue=b""):
        sure = next((cell for cell in column if _SURE.fullmatch(cell)), None) if mark else None
        if sure is not None:
            raise FormatError(path, f'expected plain numbers, got a thousands separator in "{_shown(sure)}"', _REMEDY)
        for each in alone:
            grouped = [cell for cell in column if _ONE[each].fullmatch(cell)]
            whole = any(_WHOLE.fullmatch(cell) for cell in column) and not any(map(_LONG.fullmatch, column))
            other_is_decimal = points and commas and len(alone) == 1
            if grouped and (other_is_decimal or whole):
                problem = f'"{_shown(grouped[0])}" may have a thousands separator or a decimal mark'
                raise FormatError(path, problem, _REMEDY)
            if grouped and each == b",":
                doubtful = doubtful or grouped[0]
    return "" if points else _shown(doubtful)


def _shown(cell: bytes) -> str:
    return cell.decode("utf-8", "replace")
