"""Vernier Format 2: the text that Logger Pro exports and imports, tab separated.

Line 1 is ``Vernier Format 2``, line 2 a title, line 3 the name of the data set. Then come long names, short names and
units, or, from small programs, only long names and units, or headings with units in brackets. Further data sets
follow, each with its name and headings.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from acquisition.errors import FormatError
from acquisition.recordings.tables.contents import Channel, Contents, Heading, Sheet, channels_of, name_and_unit
from acquisition.recordings.tables.sheet import ColumnFormat
from acquisition.recordings.tables.text import Line, Text, decode, is_text, parse_number, text_of

__all__ = ["FORMAT"]

_MAGIC = "Vernier Format 2"
_MOST_HEADINGS = 3
_MOST_LINES = 40


@dataclass(frozen=True, slots=True)
class _Set:
    """One data set: its name, the lines of its headings, and the first line of its rows."""

    name: str
    start: int
    headings: tuple[str, ...]
    rows: Line


def _evidence(head: bytes) -> str:
    if is_text(head) and decode(head).lstrip().startswith(_MAGIC):
        return f'line 1 is "{_MAGIC}"'
    return ""


def _contents(path: str, data: bytes) -> Contents:
    text = text_of(path, data)
    first = next(text.lines(), None)
    if first is None or not first.text.lstrip().startswith(_MAGIC):
        raise FormatError(path, f'expected "{_MAGIC}" in line 1', "export the run again", line=1)
    title = next((line.text.strip() for line in text.head(2)[1:]), "")
    sets = list(_sets(text))
    channels: list[Channel] = []
    for number, each in enumerate(sets):
        stop = sets[number + 1].start if number + 1 < len(sets) else text.stop
        sheet = Sheet(text, each.rows.start, stop, each.rows.number, "\t")
        run = each.name if len(sets) > 1 else ""
        channels.extend(channels_of(sheet, _headings(each.headings, run)))
    if not channels:
        raise FormatError(path, "expected names, units and rows below the title", "export the run again", line=3)
    return Contents(tuple(channels), title=title, zeros=text.zeros)


def _sets(text: Text) -> Iterator[_Set]:
    lines = list(text.head(2))
    at, number = (lines[-1].next, lines[-1].number + 1) if len(lines) == 2 else (text.stop, 1)
    while (data_set := _set(text, at, number)) is not None:
        yield data_set
        # The next set repeats the line of long names, with its own name above.
        again = text.data.find(_encoded(text, data_set.headings[0]), data_set.rows.start, text.stop)
        if again < 0:
            return
        above = text.data.rfind(b"\n", data_set.rows.start, again - 1)
        at = text.data.rfind(b"\n", data_set.rows.start, max(above, data_set.rows.start)) + 1 or data_set.rows.start
        number = data_set.rows.number + text.data.count(b"\n", data_set.rows.start, at)
        if at <= data_set.rows.start:
            return


def _encoded(text: Text, headings: str) -> bytes:
    raw = headings.encode("utf-8")
    return b"\n" + (raw if raw in text.data[text.start : text.start + 65536] else headings.encode("cp1252", "replace"))


def _set(text: Text, at: int, number: int) -> _Set | None:
    """Read the name and the headings of a data set; return None if no rows follow."""
    above: list[Line] = []
    for line in text.lines(at, number):
        if not line.text.strip() and not line.text.strip(" "):
            continue
        cells = line.text.strip().split("\t")
        numbers = [parse_number(cell.strip()) for cell in cells]
        if (
            above
            and any(each is not None for each in numbers)
            and not any(c.strip() and n is None for c, n in zip(cells, numbers, strict=True))
        ):
            name = above[0].text.strip() if "\t" not in above[0].text.strip() else ""
            headings = tuple(each.text for each in above[1 if name else 0 :])
            return _Set(name, at, headings, line) if 1 <= len(headings) <= _MOST_HEADINGS else None
        above.append(line)
        if len(above) == _MOST_LINES:
            return None
    return None


def _headings(lines: Sequence[str], run: str) -> list[Heading]:
    """Combine long names with units; the units are in the last of two or three lines."""
    names = [cell.strip() for cell in lines[0].rstrip().split("\t")]
    if len(lines) == 1:
        return [Heading(*name_and_unit(name), run) for name in names]
    units = [cell.strip().strip("()") for cell in lines[-1].split("\t")]
    units += [""] * (len(names) - len(units))
    return [Heading(name, unit, run) for name, unit in zip(names, units, strict=False)]


FORMAT = ColumnFormat("vernier", "Vernier Format 2 text of Logger Pro", _evidence, _contents)
