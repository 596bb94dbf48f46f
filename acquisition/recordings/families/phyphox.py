"""phyphox: exports as CSV with quoted headings, and saved states as XML.

The phone measures the times, so their steps vary (9.964 to 9.972 ms); each sensor may have a separate column of
times. In the XML, the ``init`` attribute of each container lists the numbers of a buffer, and ``<export>`` names the
buffers.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from acquisition.block import F8
from acquisition.errors import FormatError
from acquisition.recordings.tables.contents import (
    Channel,
    Contents,
    Heading,
    is_time,
    name_and_unit,
    split_heading,
)
from acquisition.recordings.tables.markup import read_markup, side_by_side
from acquisition.recordings.tables.sheet import ColumnFormat, headed_format
from acquisition.recordings.tables.text import decode, head_lines, parse_number, text_of

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

__all__ = ["FORMAT"]

_QUOTED = re.compile(r'\s*(?:"[^"]*"[,;\t]?)+\s*')
_ROOT = re.compile(
    r"\s*(?:<\?xml[^>]*>\s*)?(?:<!--.*?-->\s*)*(?:<!DOCTYPE[^>\[]*(?:\[.*?\])?\s*>\s*)?<phyphox[\s>]", re.DOTALL
)


def _headings(line: str) -> tuple[tuple[Heading, ...], str]:
    """Return quoted headings, if the first is a time with its unit (else none), and their separator."""
    if not _QUOTED.fullmatch(line):
        return (), ""
    cells, mark = split_heading(line)
    headings = tuple(Heading(*name_and_unit(cell)) for cell in cells)
    if len(headings) < 2 or not is_time(headings[0].name) or not headings[0].unit:
        return (), mark
    return headings, mark


def _why(headings: tuple[Heading, ...], mark: str) -> str:  # noqa: ARG001
    return f'line 1 is quoted headings that begin with "{headings[0].name} ({headings[0].unit})"'


def _evidence(head: bytes) -> str:
    if _ROOT.match("\n".join(head_lines(head))):
        return "it is XML with the root <phyphox>"
    return _CSV.evidence(head)


def _contents(path: str, data: bytes) -> Contents:
    text = text_of(path, data)
    if _ROOT.match(decode(text.data[text.start : text.start + 8192])):
        return _of_xml(path, text.data[text.start : text.stop])
    return _CSV.contents(path, data)


def _of_xml(path: str, data: bytes) -> Contents:
    root = read_markup(path, data, "save the experiment in phyphox again")
    buffers = dict(_buffers(root))
    channels = tuple(_channels(root, buffers))
    if not channels:
        problem = "expected buffers with numbers and an export that names them, got none"
        raise FormatError(path, problem, "save the state after recording, or export the data as CSV")
    title = next((each.text.strip() for each in root.iter("title") if each.text), "")
    return Contents(channels, title=title)


def _buffers(root: Element) -> Iterator[tuple[str, F8]]:
    for each in root.iter("container"):
        numbers = [parse_number(cell.strip()) for cell in each.get("init", "").split(",") if cell.strip()]
        if numbers and each.text:
            yield each.text.strip(), np.array([np.nan if x is None else x for x in numbers])


def _channels(root: Element, buffers: Mapping[str, F8]) -> Iterator[Channel]:
    """Yield the channels of every set in the export, each with the times of its set."""
    sets = list(root.iter("set"))
    for each in sets:
        run = each.get("name", "") if len(sets) > 1 else ""
        columns = []
        for data in each.iter("data"):
            name, unit = name_and_unit(data.get("name", ""))
            values = buffers.get((data.text or "").strip())
            if values is not None:
                columns.append((name, unit, values))
        yield from side_by_side(columns, [at for at, (name, _, _) in enumerate(columns) if is_time(name)], run)


_TITLE = "phyphox export as CSV, or saved state as XML"
_CSV = headed_format("phyphox", _TITLE, _headings, _why, '"Time (s)","Distance (m)", in quotes')
FORMAT = ColumnFormat("phyphox", _TITLE, _evidence, _contents)
