"""Logger Pro and Graphical Analysis CSV: runs side by side under ``Latest: Position (m)`` or ``Data Set 1:Time(s)``."""

from __future__ import annotations

import re

from acquisition.recordings.tables.contents import Heading, is_time, name_and_unit, split_heading
from acquisition.recordings.tables.sheet import headed_format

__all__ = ["FORMAT"]

_OF_RUN = re.compile(r"(?P<run>[^:]+):\s*(?P<quantity>.+)")


def _headings(line: str) -> tuple[tuple[Heading, ...], str]:
    cells, mark = split_heading(line)
    found = [match for cell in cells if (match := _OF_RUN.fullmatch(cell))]
    if len(found) < 2 or len(found) != len(cells):
        return (), mark
    headings = tuple(Heading(*name_and_unit(each["quantity"]), each["run"].strip()) for each in found)
    known = any(is_time(each.name) for each in headings) or all(each.unit for each in headings)
    return (headings, mark) if known else ((), mark)


def _why(headings: tuple[Heading, ...], mark: str) -> str:  # noqa: ARG001
    return f'headings in line 1 begin with a run, "{headings[0].run}: "'


FORMAT = headed_format("logger-pro", "Logger Pro CSV: runs side by side", _headings, _why, '"Latest: Position (m)"')
