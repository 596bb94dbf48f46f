"""CASSY Lab: ``.labx`` (XML with readable numbers) and the older ``.lab`` (text that begins with ``CL4`` or similar).

In the XML every ``channel`` has its ``quantity``, ``symbol``, ``unit`` and ``values``; an empty value is a lost sample.
In the text, three lines (quantity, symbol, unit) and a line of settings describe each channel. A line with the numbers
of columns and rows comes before the rows, whose cells are separated by tabs.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from acquisition.block import F8
from acquisition.errors import FormatError
from acquisition.recordings.tables.contents import Channel, Contents, Sheet, is_time, numbered_apart
from acquisition.recordings.tables.markup import read_markup, side_by_side
from acquisition.recordings.tables.sheet import ColumnFormat
from acquisition.recordings.tables.text import Text, decode, head_lines, parse_number, text_of

__all__ = ["FORMAT"]

_ROOT = re.compile(r"\s*(?:<\?xml[^>]*>\s*)?<cassylab[\s>]")
_MAGIC = re.compile(r"CL\d")
_MOST_HEAD_LINES = 1000
_REMEDY = "save it again, or export it as text in CASSY Lab"


def _evidence(head: bytes) -> str:
    lines = head_lines(head)
    if _ROOT.match("\n".join(lines)):
        return "it is XML with the root <cassylab>"
    if _MAGIC.fullmatch(lines[0].strip()) and len(lines) > 3:
        return f'line 1 is "{lines[0].strip()}"'
    return ""


def _contents(path: str, data: bytes) -> Contents:
    text = text_of(path, data)
    if _ROOT.match(decode(text.data[text.start : text.start + 8192])):
        return _of_markup(path, text.data[text.start : text.stop])
    return _of_text(path, text)


def _of_markup(path: str, data: bytes) -> Contents:
    columns: list[tuple[str, str, str, F8]] = []
    for each in read_markup(path, data, _REMEDY).iter("channel"):
        cells = [parse_number((value.text or "").strip()) for value in each.iter("value")]
        if cells:
            name, symbol, unit = ((each.findtext(tag) or "").strip() for tag in ("quantity", "symbol", "unit"))
            columns.append((name, symbol, unit, np.array([np.nan if x is None else x for x in cells])))
    names = numbered_apart([f"{name} {symbol}".strip() for name, symbol, _, _ in columns])
    channels = side_by_side(
        [(label, unit, values) for label, (_, _, unit, values) in zip(names, columns, strict=True)],
        [column for column, each in enumerate(columns) if is_time(each[0])],
    )
    channels = [replace(each, aside=each.name.startswith("Index")) for each in channels]
    if not channels:
        raise FormatError(path, "expected channels with values, got none", _REMEDY)
    return Contents(tuple(channels))


def _of_text(path: str, text: Text) -> Contents:
    lines = text.head(_MOST_HEAD_LINES)
    for at, line in enumerate(lines[:-1]):
        size = re.fullmatch(r"(\d+) (\d+)", line.text.strip())
        row = lines[at + 1].text.rstrip("\t").split("\t")
        if size and len(row) == int(size[1]) > 1 and all(parse_number(cell) is not None for cell in row if cell):
            return _of_rows(path, text, [each.text for each in lines[:at]], at + 1, int(size[1]))
    raise FormatError(path, "expected the numbers of columns and rows, and the rows below", _REMEDY)


def _of_rows(path: str, text: Text, above: Sequence[str], first: int, width: int) -> Contents:
    # Three lines of words and one line of sixteen settings describe a channel.
    described = [
        tuple(above[at - back].strip() for back in (3, 2, 1))
        for at, line in enumerate(above)
        if at >= 3 and len(cells := line.split()) == 16 and all(parse_number(cell) is not None for cell in cells)
    ]
    if len(described) == width + 1 and described[2][2] == "Hz":
        del described[2]  # the axis of the spectrum is described after index and time, but has no column
    if len(described) != width:
        raise FormatError(path, f"expected {width} channels above the rows, got {len(described)}", _REMEDY)
    lines = text.head(first + 1)
    # Settings follow the rows and contain no tabs; if their first line has no end, it is an incomplete row.
    tab = text.data.rfind(b"\t", lines[first].start, text.stop)
    end = next((line.next for line in text.lines(tab)), text.stop)
    stop = end if b"\n" in text.data[end : text.stop] else text.stop
    times = [column for column, (name, _, _) in enumerate(described) if is_time(name)]
    names = numbered_apart([f"{name} {symbol}".strip() for name, symbol, _ in described])
    sheet = Sheet(text, lines[first].start, stop, first + 1, "\t", names=tuple(names))
    time = times[0] if times else None
    time_unit = described[time][2] if time is not None else ""
    channels = [
        Channel(names[column], unit, sheet, "", column, time, time_unit, ragged=True, aside=name == "Index")
        for column, (name, _, unit) in enumerate(described)
        if column not in times
    ]
    return Contents(tuple(channels), zeros=text.zeros)


FORMAT = ColumnFormat("cassy", "CASSY Lab: saved as labx (XML) or lab (text)", _evidence, _contents)
