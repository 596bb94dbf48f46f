"""PASCO DataStudio: a line ``Voltage, ChA, Run #1``, a line ``Time ( s )<TAB>Voltage ( V )``, rows; then the next run.

Most numbers are fixed point; small ones have an exponent (``-2.441E-4``). Times are row numbers divided by the rate.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from acquisition.errors import FormatError
from acquisition.recordings.tables.contents import (
    Channel,
    Contents,
    Heading,
    Sheet,
    channels_of,
    name_and_unit,
    split_heading,
)
from acquisition.recordings.tables.sheet import ColumnFormat
from acquisition.recordings.tables.text import Line, Text, head_lines, text_of

__all__ = ["FORMAT"]

_TITLE = re.compile(r"(?P<name>[^\t;]+), (?P<run>\S+ #\s?\d+)\s*")
_MARK = b" #"


def _headings(title: str, line: str) -> tuple[Heading, ...]:
    """Return the headings that two lines contain; none for lines of another family."""
    of_run = _TITLE.fullmatch(title)
    cells, _ = split_heading(line)
    named = [name_and_unit(cell) for cell in cells]
    if of_run is None or len(cells) < 2 or not all(unit for _, unit in named):
        return ()
    return tuple(Heading(name, unit, of_run["run"]) for name, unit in named)


def _evidence(head: bytes) -> str:
    lines = head_lines(head)
    if len(lines) > 1 and _headings(lines[0], lines[1]):
        return f'line 1 is the run, "{lines[0].strip()}", line 2 the headings with units'
    return ""


def _contents(path: str, data: bytes) -> Contents:
    text = text_of(path, data)
    channels: list[Channel] = []
    titles = []
    blocks = list(_blocks(text))
    stops = [*(title.start for title, _ in blocks), text.stop][1:]
    for (title, line), stop in zip(blocks, stops, strict=True):
        titles.append(title.text.strip())
        sheet = Sheet(text, line.next, stop, line.number + 1, split_heading(line.text)[1])
        channels.extend(channels_of(sheet, _headings(title.text, line.text)))
    if not channels:
        problem = 'expected a line like "Position, ChA, Run #1" and one of headings with units'
        raise FormatError(path, problem, "export the run again", line=1)
    return Contents(tuple(channels), title=" / ".join(titles[:4]), zeros=text.zeros)


def _blocks(text: Text) -> Iterator[tuple[Line, Line]]:
    """Yield the two header lines of each run."""
    at, number = text.start, 1
    while at >= 0:
        two = [line for line, _ in zip(text.lines(at, number), range(2), strict=False)]
        if len(two) == 2 and _headings(two[0].text, two[1].text):
            yield two[0], two[1]
        if len(two) < 2:
            return
        mark_at = text.data.find(_MARK, two[0].next, text.stop)
        if mark_at < 0:
            return
        begin = max(text.data.rfind(b"\n", 0, mark_at), text.data.rfind(b"\r", 0, mark_at)) + 1
        counted = text.data[at:begin]
        number += counted.count(b"\n") or counted.count(b"\r")
        at = begin if begin > at else two[0].next


FORMAT = ColumnFormat("datastudio", "PASCO DataStudio text: runs one below the other", _evidence, _contents)
