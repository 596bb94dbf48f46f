"""Read recordings in XML, without document types, entities or external references."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from acquisition.block import F8
from acquisition.errors import FormatError
from acquisition.recordings.tables.cells import parse_number
from acquisition.recordings.tables.format import ColumnFormat
from acquisition.recordings.tables.headings import Heading
from acquisition.recordings.tables.table import Column, Table, side_by_side
from acquisition.recordings.tables.text import HEAD_BYTES, decode

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

MOST_BYTES = 1 << 26
"""Maximum size of XML, bytes. Files of school programs are smaller; parsing takes about twenty times the memory."""


def read_markup(path: str, data: bytes, remedy: str) -> Element:
    """Return the root of an XML file without a document type, which may name other files or expand without limit."""
    from xml.etree import ElementTree

    if not data.lstrip(b"\xef\xbb\xbf \r\n").startswith(b"<?xml"):
        data = decode(data).encode()  # XML without a declaration must be UTF-8, but old programs use other codes

    if len(data) > MOST_BYTES:
        raise FormatError(path, f"expected at most {MOST_BYTES} bytes of XML, got {len(data)}", remedy)
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise FormatError(path, "expected plain XML, got a document type", remedy)
    try:
        return ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise FormatError(path, f"expected XML, got {error}", remedy) from error


def with_markup(
    text: ColumnFormat, evidence: Callable[[bytes], str], tables: Callable[[str, bytes], Sequence[Table]]
) -> ColumnFormat:
    """Return a format of text whose programs also save markup, which has separate evidence and tables."""
    return replace(
        text,
        evidence=lambda head: evidence(head) or text.evidence(head),
        tables=lambda path, data: (tables if evidence(data[:HEAD_BYTES]) else text.tables)(path, data),
    )


def numbers(cells: Iterable[str]) -> F8:
    """Return the numbers in cells; NaN for cells that are not numbers."""
    return np.array([np.nan if x is None else x for x in (parse_number(cell.strip()) for cell in cells)], np.float64)


def tables_of_markup(columns: Sequence[tuple[Heading, F8]], run: str = "") -> list[Table]:
    """Return the tables of columns that have been read; shorter ones end in NaN."""
    read = [Column(each.name, each.unit, values) for each, values in columns]
    return side_by_side(read, [each for each, _ in columns], run=run)
