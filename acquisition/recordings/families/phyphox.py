"""phyphox: the saved state of an experiment, XML with the numbers of every buffer.

The ``init`` attribute of each container lists the numbers of a buffer, and ``<export>`` names the buffers.
"""

from __future__ import annotations

import re
from dataclasses import replace

from acquisition.errors import FormatError
from acquisition.recordings.families.markup import begins, numbers_of, read_markup, tables_of
from acquisition.recordings.tables.format import ColumnFormat
from acquisition.recordings.tables.headings import Heading, name_and_unit
from acquisition.recordings.tables.table import Table
from acquisition.recordings.tables.text import text_of

_ROOT = re.compile(
    r"\s*(?:<\?xml[^>]*>\s*)?(?:<!--.*?-->\s*)*(?:<!DOCTYPE[^>\[]*(?:\[.*?\])?\s*>\s*)?<phyphox[\s>]", re.DOTALL
)


def _tables(path: str, data: bytes) -> list[Table]:
    text = text_of(path, data)
    root = read_markup(path, text.data, "save the experiment in phyphox again")
    buffers = {}
    for each in root.iter("container"):
        values = numbers_of(cell for cell in each.get("init", "").split(",") if cell.strip())
        if values.size and each.text:
            buffers[each.text.strip()] = values
    title = next((each.text.strip() for each in root.iter("title") if each.text), "")
    tables: list[Table] = []
    sets = list(root.iter("set"))
    for each in sets:  # each with its own times
        named = [(name_and_unit(data.get("name", "")), (data.text or "").strip()) for data in each.iter("data")]
        columns = [(Heading(*heading), buffers[buffer]) for heading, buffer in named if buffer in buffers]
        tables += tables_of(columns, each.get("name", "") if len(sets) > 1 else "")
    if not tables:
        problem = "expected buffers with numbers and an export that names them, got none"
        raise FormatError(path, problem, "save the state after recording, or export the data as CSV")
    return [replace(each, title=title) for each in tables]


FORMAT = ColumnFormat(
    "phyphox",
    "phyphox: saved state as XML",
    lambda head: "it is XML with the root <phyphox>" if begins(head, _ROOT) else "",
    _tables,
)
