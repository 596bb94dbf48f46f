"""XML that holds a recording: read without document types, entities or references to anything outside."""

from __future__ import annotations

from typing import TYPE_CHECKING

from acquisition.errors import FormatError

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

__all__ = ["MOST_BYTES", "read_markup"]

MOST_BYTES = 1 << 26
"""More than any recording of a school's program; a tree takes some twenty times as much memory."""


def read_markup(path: str, data: bytes, remedy: str) -> Element:
    """Return the root of a file that is XML.

    Raises
    ------
    FormatError
        If it is none, too long, or has a document type: that may name other files, or grow without bound.
    """
    from xml.etree import ElementTree

    if len(data) > MOST_BYTES:
        raise FormatError(path, f"expected at most {MOST_BYTES} bytes of XML, got {len(data)}", remedy)
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise FormatError(path, "expected plain XML, got a document type", remedy)
    try:
        return ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise FormatError(path, f"expected XML, got {error}", remedy) from error
