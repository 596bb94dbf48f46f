"""Columns under headings with units, times first: ``Time (s),Distance (m)``. springmass writes such files itself."""

from __future__ import annotations

from acquisition.recordings.families import capstone, logger_pro, motion_sensor, phyphox
from acquisition.recordings.tables.contents import (
    Contents,
    Heading,
    is_time,
    name_and_unit,
    split_heading,
    under_first_line,
)
from acquisition.recordings.tables.sheet import ColumnFormat
from acquisition.recordings.tables.text import decode, is_text, parse_number, unify

__all__ = ["FORMAT"]


def _headings(line: str) -> tuple[tuple[Heading, ...], str]:
    cells, mark = split_heading(line)
    headings = tuple(Heading(*name_and_unit(cell)) for cell in cells)
    if len(headings) < 2 or not is_time(headings[0].name) or not all(each.unit for each in headings):
        return (), mark
    return headings, mark


def _evidence(head: bytes) -> str:
    if not is_text(head):
        return ""
    lines = unify(decode(head)).split("\n")
    headings, mark = _headings(lines[0])
    if not headings or _is_of_others(head):
        return ""
    row = lines[1].split(mark) if len(lines) > 1 else []
    if row and row[0].strip() and parse_number(row[0].strip(' "')) is None:
        return ""
    return f'line 1 is headings with units that begin with "{headings[0].name} ({headings[0].unit})"'


def _is_of_others(head: bytes) -> bool:
    """Tell headings of the families that have more to say of such columns."""
    others = (capstone.FORMAT, logger_pro.FORMAT, phyphox.FORMAT, motion_sensor.FORMAT)
    return any(each.recognises(head) for each in others)


def _contents(path: str, data: bytes) -> Contents:
    return under_first_line(path, data, _headings, '"Time (s),Distance (m)"')


FORMAT = ColumnFormat("csv", "columns under headings with units, times first", _evidence, _contents)
