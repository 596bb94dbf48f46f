"""CASSY Lab: ``.labx`` (XML with readable numbers) and the older ``.lab`` (text that begins with ``CL4`` or similar).

In the XML every ``channel`` has its ``quantity``, ``symbol``, ``unit`` and ``values``; an empty value is a lost sample.
In the text, three lines (quantity, symbol, unit) and a line of settings describe each channel. A line with the numbers
of columns and rows comes before the rows, whose cells are separated by tabs.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from acquisition.errors import FormatError
from acquisition.recordings.tables.cells import parse_number
from acquisition.recordings.tables.format import ColumnFormat
from acquisition.recordings.tables.headings import Heading, Role, is_time
from acquisition.recordings.tables.markup import numbers, read_markup, tables_of_markup
from acquisition.recordings.tables.rows import read_rows
from acquisition.recordings.tables.table import Table, side_by_side
from acquisition.recordings.tables.text import Text, decode, head_lines, text_of

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


def _tables(path: str, data: bytes) -> list[Table]:
    text = text_of(path, data)
    if _ROOT.match(decode(text.data[text.start : text.start + 8192])):
        return _of_markup(path, text.data[text.start : text.stop])
    return _of_text(path, text)


def _heading(name: str, symbol: str, unit: str) -> Heading:
    role: Role = "time" if is_time(name) else "aside" if name == "Index" else "channel"
    return Heading(f"{name} {symbol}".strip(), unit, role=role)


def _of_markup(path: str, data: bytes) -> list[Table]:
    columns = []
    for each in read_markup(path, data, _REMEDY).iter("channel"):
        values = numbers(value.text or "" for value in each.iter("value"))
        if values.size:
            described = ((each.findtext(tag) or "").strip() for tag in ("quantity", "symbol", "unit"))
            columns.append((_heading(*described), values))
    tables = tables_of_markup(columns)
    if not tables:
        raise FormatError(path, "expected channels with values, got none", _REMEDY)
    return tables


def _of_text(path: str, text: Text) -> list[Table]:
    lines = text.head(_MOST_HEAD_LINES)
    for at, line in enumerate(lines[:-1]):
        size = re.fullmatch(r"(\d+) (\d+)", line.text.strip())
        row = lines[at + 1].text.rstrip("\t").split("\t")
        if size and len(row) == int(size[1]) > 1 and all(parse_number(cell) is not None for cell in row if cell):
            break
    else:
        raise FormatError(path, "expected the numbers of columns and rows, and the rows below", _REMEDY)
    headings, first = _described(path, [each.text for each in lines[:at]], len(row)), lines[at + 1]
    # Settings follow the rows and contain no tabs; if their first line has no end, it is an incomplete row.
    tab = text.data.rfind(b"\t", first.start, text.stop)
    end = next((line.next for line in text.lines(tab)), text.stop)
    stop = end if b"\n" in text.data[end : text.stop] else text.stop
    columns, rows, traps = read_rows(path, text, first, "\t", stop=stop)
    return side_by_side(columns, headings, Table((), ragged=True, traps=traps, lines=rows))


def _described(path: str, above: Sequence[str], width: int) -> list[Heading]:
    """Return the headings: three lines of words and one line of sixteen settings describe a channel."""
    described = [
        tuple(above[at - back].strip() for back in (3, 2, 1))
        for at, line in enumerate(above)
        if at >= 3 and len(cells := line.split()) == 16 and all(parse_number(cell) is not None for cell in cells)
    ]
    if len(described) == width + 1 and described[2][2] == "Hz":
        del described[2]  # the axis of the spectrum is described after index and time, but has no column
    if len(described) != width:
        raise FormatError(path, f"expected {width} channels above the rows, got {len(described)}", _REMEDY)
    return [_heading(*each) for each in described]


FORMAT = ColumnFormat("cassy", "CASSY Lab: saved as labx (XML) or lab (text)", _evidence, _tables)
