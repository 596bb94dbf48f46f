"""Tracker: positions of a mass on video, under an optional line ``mass A`` and a line ``t x y``.

Neither has a unit: lengths are in whatever the calibration stick was given in, so the unit is asked for. Times are
frames over 25 or 30 per second. The names of the mass are those of the user's language.
"""

from __future__ import annotations

from collections.abc import Sequence

from acquisition.errors import FormatError
from acquisition.recordings.tables.contents import Contents, Heading, Sheet, channels_of, name_and_unit, split_heading
from acquisition.recordings.tables.sheet import ColumnFormat
from acquisition.recordings.tables.text import Line, Text, guess_delimiter, head_lines, parse_number, text_of

__all__ = ["FORMAT"]

_COORDINATES = frozenset(("x", "y", "r"))


def _cells(line: str) -> tuple[list[str], str]:
    if "\t" in line or ";" in line or "," in line:
        return split_heading(line)
    return line.split(), ""


def _find(lines: Sequence[str]) -> int:
    """Return which of the first two lines is the headings; -1 where none is, or no row follows."""
    for at, line in enumerate(lines[:2]):
        cells, mark = _cells(line)
        names = [name_and_unit(cell)[0] for cell in cells]
        if len(names) > 1 and names[0] == "t" and _COORDINATES & set(names):
            above = [cell for cell in _cells(lines[0])[0] if cell] if at else []
            row = lines[at + 1].split(mark or None) if len(lines) > at + 1 else []
            numbers = [parse_number(cell.strip()) for cell in row if cell.strip()]
            return at if (not at or len(above) <= 2) and numbers and None not in numbers[:1] else -1
    return -1


def _evidence(head: bytes) -> str:
    lines = head_lines(head)
    at = _find(lines)
    if at < 0:
        return ""
    mass = f' below "{_mass(lines[0])}"' if at else ""
    return f'line {at + 1} is "{" ".join(_cells(lines[at])[0])}"{mass}'


def _mass(line: str) -> str:
    return " ".join(cell for cell in _cells(line)[0] if cell)


def _contents(path: str, data: bytes) -> Contents:
    text = text_of(path, data)
    head = text.head(3)
    at = _find([line.text for line in head])
    if at < 0:
        raise FormatError(path, 'expected a line "t x y"', "export the table again, times first", line=1)
    cells, mark = _cells(head[at].text)
    headings = [Heading(*name_and_unit(cell)) for cell in cells]
    sheet = Sheet(text, head[at].next, text.stop, at + 2, mark or _row_mark(text, head[at]))
    title = _mass(head[0].text) if at else ""
    return Contents(channels_of(sheet, headings, clock="device"), title=title, zeros=text.zeros)


def _row_mark(text: Text, headings: Line) -> str:
    """Return what separates the rows' cells where the headings are separated by blanks."""
    row = next(text.lines(headings.next), None)
    return guess_delimiter(row.text) if row else ""


FORMAT = ColumnFormat("tracker", "Tracker table: t x y of a mass on video", _evidence, _contents)
