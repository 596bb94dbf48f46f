"""phyphox: exports as CSV with quoted headings, and saved states as XML.

The CSV is in :mod:`acquisition.recordings.families.dialects`. In the XML, the ``init`` attribute of each container
lists the numbers of a buffer, and ``<export>`` names the buffers.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from acquisition.block import F8
from acquisition.errors import FormatError
from acquisition.recordings.families.dialects import phyphox
from acquisition.recordings.tables.dialect import text_format
from acquisition.recordings.tables.headings import Heading, name_and_unit
from acquisition.recordings.tables.markup import numbers, read_markup, tables_of_markup, with_markup
from acquisition.recordings.tables.table import Table
from acquisition.recordings.tables.text import head_lines, text_of

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

_ROOT = re.compile(
    r"\s*(?:<\?xml[^>]*>\s*)?(?:<!--.*?-->\s*)*(?:<!DOCTYPE[^>\[]*(?:\[.*?\])?\s*>\s*)?<phyphox[\s>]", re.DOTALL
)


def _evidence(head: bytes) -> str:
    return "it is XML with the root <phyphox>" if _ROOT.match("\n".join(head_lines(head))) else ""


def _tables(path: str, data: bytes) -> list[Table]:
    text = text_of(path, data)
    root = read_markup(path, text.data[text.start : text.stop], "save the experiment in phyphox again")
    buffers = dict(_buffers(root))
    title = next((each.text.strip() for each in root.iter("title") if each.text), "")
    tables = [replace(each, title=title) for each in _sets(root, buffers)]
    if not tables:
        problem = "expected buffers with numbers and an export that names them, got none"
        raise FormatError(path, problem, "save the state after recording, or export the data as CSV")
    return tables


def _buffers(root: Element) -> Iterator[tuple[str, F8]]:
    for each in root.iter("container"):
        values = numbers(cell for cell in each.get("init", "").split(",") if cell.strip())
        if values.size and each.text:
            yield each.text.strip(), values


def _sets(root: Element, buffers: Mapping[str, F8]) -> Iterator[Table]:
    """Yield the tables of every set in the export, each with the times of its set."""
    sets = list(root.iter("set"))
    for each in sets:
        named = [
            (Heading(*name_and_unit(data.get("name", ""))), (data.text or "").strip()) for data in each.iter("data")
        ]
        columns = [(heading, buffers[buffer]) for heading, buffer in named if buffer in buffers]
        yield from tables_of_markup(columns, each.get("name", "") if len(sets) > 1 else "")


FORMAT = with_markup(
    text_format("phyphox", "phyphox export as CSV, or saved state as XML", phyphox, expected='"Time (s)" in quotes'),
    _evidence,
    _tables,
)
