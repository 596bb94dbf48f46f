"""Columns under headings with units, times first: ``Time (s),Distance (m)``. springmass writes such files itself."""

from __future__ import annotations

from dataclasses import replace

from acquisition.recordings.families import capstone, logger_pro, motion_sensor, phyphox
from acquisition.recordings.tables.contents import Heading, is_time, name_and_unit, split_heading
from acquisition.recordings.tables.sheet import headed_format
from acquisition.recordings.tables.text import head_lines, parse_number

__all__ = ["FORMAT"]

_OTHERS = (capstone.FORMAT, logger_pro.FORMAT, phyphox.FORMAT, motion_sensor.FORMAT)
"""Families that interpret similar columns in more detail, and to which such files are left."""


def _headings(line: str) -> tuple[tuple[Heading, ...], str]:
    cells, mark = split_heading(line)
    headings = tuple(Heading(*name_and_unit(cell)) for cell in cells)
    if len(headings) < 2 or not is_time(headings[0].name) or not all(each.unit for each in headings):
        return (), mark
    return headings, mark


def _why(headings: tuple[Heading, ...], mark: str) -> str:  # noqa: ARG001
    return f'line 1 is headings with units that begin with "{headings[0].name} ({headings[0].unit})"'


def _evidence(head: bytes) -> str:
    why = _HEADED.evidence(head)
    first, second = (*head_lines(head), "")[:2]
    cell = second.split(split_heading(first)[1])[0].strip(' "')
    numbers = not cell or parse_number(cell) is not None
    return why if why and numbers and not any(each.recognises(head) for each in _OTHERS) else ""


_HEADED = headed_format(
    "csv", "columns under headings with units, times first", _headings, _why, '"Time (s),Distance (m)"'
)
FORMAT = replace(_HEADED, evidence=_evidence)
