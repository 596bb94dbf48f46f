"""Read recordings in XML, without document types, entities or external references."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from acquisition.block import F8
from acquisition.errors import FormatError
from acquisition.recordings.tables.contents import Arrays, Channel
from acquisition.recordings.tables.text import decode

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

__all__ = ["MOST_BYTES", "read_markup", "side_by_side"]

MOST_BYTES = 1 << 26
"""Maximum size of XML, bytes. Files of school programs are smaller; parsing takes about twenty times the memory."""


def read_markup(path: str, data: bytes, remedy: str) -> Element:
    """Return the root of an XML file.

    Raises
    ------
    FormatError
        If the file is not XML, is too long, or has a document type, which may name other files or expand without limit.
    """
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


def side_by_side(columns: Sequence[tuple[str, str, F8]], times: Sequence[int], run: str = "") -> list[Channel]:
    """Return the channels of columns that have been read: each gets the times to its left, or else the first times.

    Parameters
    ----------
    columns : sequence of (str, str, (n,) float64)
        Name, unit and numbers of each column. The lengths may differ; shorter ones are filled with NaN.
    times : sequence of int
        Indices of the columns that are times.
    run : str
    """
    channels = []
    for column, (name, unit, values) in enumerate(columns):
        if column in times:
            continue
        time = max((each for each in times if each < column), default=times[0] if times else None)
        time_name, time_unit, t = ("", "", None) if time is None else columns[time]
        size = max(values.size, 0 if t is None else t.size)
        source = Arrays(None if t is None else _longer(t, size), _longer(values, size), time_name)
        channels.append(Channel(name, unit, source, run, time_unit=time_unit))
    return channels


def _longer(values: F8, size: int) -> F8:
    return np.concatenate((values, np.full(size - values.size, np.nan)))
