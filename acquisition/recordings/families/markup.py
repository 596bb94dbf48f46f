"""XML in which programs save the numbers of every channel: its root, its numbers and its tables."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from acquisition.block import F8
from acquisition.errors import FormatError
from acquisition.recordings.tables.headings import Heading
from acquisition.recordings.tables.numbers import parse_number
from acquisition.recordings.tables.table import Column, Table, side_by_side
from acquisition.recordings.tables.text import decode, head_lines

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

MOST_XML_BYTES = 1 << 26
"""Maximum size of XML, bytes. Files of school programs are smaller; parsing takes about twenty times the memory."""
BLANKS = b"\xef\xbb\xbf \r\n\t"


def read_markup(path: str, data: bytes, remedy: str) -> Element:
    """Return the root of an XML file without a document type, which may name other files or expand without limit."""
    from xml.etree import ElementTree

    if not data.lstrip(BLANKS).startswith(b"<?xml"):
        data = decode(data).encode()  # XML without a declaration must be UTF-8, but old programs use other codes

    if len(data) > MOST_XML_BYTES:
        raise FormatError(path, f"expected at most {MOST_XML_BYTES} bytes of XML, got {len(data)}", remedy)
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise FormatError(path, "expected plain XML, got a document type", remedy)
    try:
        return ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise FormatError(path, f"expected XML, got {error}", remedy) from error


def numbers_of(cells: Iterable[str]) -> F8:
    """Return the numbers in cells; NaN for cells that are not numbers."""
    return np.array([np.nan if x is None else x for x in (parse_number(cell.strip()) for cell in cells)], np.float64)


def tables_of(columns: Sequence[tuple[Heading, F8]], run: str = "") -> list[Table]:
    """Return the tables of columns that have been read; shorter ones end in NaN."""
    read = tuple(Column(each.name, each.unit, values) for each, values in columns)
    return side_by_side(Table(read), [each for each, _ in columns], run)


def begins(head: bytes, root: re.Pattern[str]) -> bool:
    """Return whether the first lines of a file begin with the root of a program's XML."""
    return bool(root.match("\n".join(head_lines(head))))
