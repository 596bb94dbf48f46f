"""CASSY Lab: saved measurements, labx (XML) and lab (text).

- In labx, every ``channel`` has its ``quantity``, ``symbol``, ``unit`` and ``values``; an empty value is a lost sample.
- In the older lab files, text that begins with ``CL4`` or similar, three lines (quantity, symbol, unit) and a line of
  settings describe each channel. A line with the numbers of columns and rows comes before the rows.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from acquisition.errors import FormatError
from acquisition.recordings.families.markup import begins, numbers_of, read_markup, tables_of
from acquisition.recordings.tables.format import ColumnFormat
from acquisition.recordings.tables.headings import ColumnRole, Heading, is_time
from acquisition.recordings.tables.numbers import parse_number
from acquisition.recordings.tables.rows import read_rows
from acquisition.recordings.tables.table import Table, side_by_side
from acquisition.recordings.tables.text import HEAD_BYTES, Text, head_lines, text_of

_ROOT = re.compile(r"\s*(?:<\?xml[^>]*>\s*)?<cassylab[\s>]")
_OLDER = re.compile(r"CL\d")
_MOST_HEAD_LINES = 1000
_EXPORT = "save it again, or export it as text in CASSY Lab"
_COMPUTED = re.compile(r"10( -?\d+){3}")


def _evidence(head: bytes) -> str:
    lines = head_lines(head)
    if begins(head, _ROOT):
        return "it is XML with the root <cassylab>"
    if _OLDER.fullmatch(lines[0].strip()) and len(lines) > 3:
        return f'line 1 is "{lines[0].strip()}"'
    return ""


def _tables(path: str, data: bytes) -> list[Table]:
    text = text_of(path, data)
    if not begins(data[:HEAD_BYTES], _ROOT):
        return _older_tables(path, text)
    columns = []
    for each in read_markup(path, text.data, _EXPORT).iter("channel"):
        values = numbers_of(value.text or "" for value in each.iter("value"))
        if values.size:
            described = ((each.findtext(tag) or "").strip() for tag in ("quantity", "symbol", "unit"))
            columns.append((_heading(*described), values))
    tables = tables_of(columns)
    if not tables:
        raise FormatError(path, "expected channels with values, got none", _EXPORT)
    return tables


def _heading(name: str, symbol: str, unit: str) -> Heading:
    role: ColumnRole = "time" if is_time(name) else "aside" if name == "Index" else "channel"
    return Heading(f"{name} {symbol}".strip(), unit, role=role)


def _older_tables(path: str, text: Text) -> list[Table]:
    lines = text.head(_MOST_HEAD_LINES)
    for at, line in enumerate(lines[:-1]):
        size = re.fullmatch(r"(\d+) (\d+)", line.strip())
        row = lines[at + 1].rstrip("\t").split("\t")
        if size and len(row) == int(size[1]) > 1 and all(parse_number(cell) is not None for cell in row if cell):
            break
    else:
        raise FormatError(path, "expected the numbers of columns and rows, and the rows below", _EXPORT)
    # Settings follow the rows and contain no tabs; if their first line has no end, it is an incomplete row.
    tab = text.at(text.data.rfind(b"\t"))
    stop = tab + 1 if tab + 2 < len(text) or text.ended else len(text)
    table = read_rows(path, text, at + 1, stop, "\t")
    return side_by_side(replace(table, ragged=True), _described(path, lines[:at], len(row)))


def _described(path: str, above: Sequence[str], width: int) -> list[Heading]:
    """Return the headings: three lines of words and one line of sixteen settings describe a channel.

    The axis of the spectrum is described after index and time, but has no column; nor have the channels that are
    computed, whose description begins with a line like ``10 4 0 0``, if there are fewer columns than channels.
    """
    places = [
        at
        for at, line in enumerate(above)
        if at >= 3 and len(cells := line.split()) == 16 and all(parse_number(cell) is not None for cell in cells)
    ]
    described = [tuple(above[at - back].strip() for back in (3, 2, 1)) for at in places]
    computed = [
        any(_COMPUTED.fullmatch(line.strip()) for line in above[before + 1 : at])
        for before, at in pairwise([-1, *places])
    ]
    if len(described) > width and described[2][2] == "Hz":
        del described[2], computed[2]
    for at in [at for at, is_computed in enumerate(computed) if is_computed][::-1]:
        if len(described) > width:
            del described[at]
    if len(described) != width:
        raise FormatError(path, f"expected {width} channels above the rows, got {len(described)}", _EXPORT)
    return [_heading(*each) for each in described]


FORMAT = ColumnFormat("cassy", "CASSY Lab: saved as labx (XML) or lab (text)", _evidence, _tables)
