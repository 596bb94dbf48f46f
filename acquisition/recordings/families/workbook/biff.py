"""An xls written anew (MS-XLS, BIFF5 and BIFF8): cells and what they need, each sheet's size known before it is read.

calamine reserves what a file declares: a DIMENSIONS record of 65,536 rows by 65,536 columns, a table of two thousand
million strings, a chain of sectors without end. So only the records that a value needs are kept, and they are counted.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from acquisition.recordings.families.workbook.compound import Damage, container_of, stream_of

__all__ = ["Sizes", "rewritten"]

_EOF, _CONTINUE, _SHEET, _STRINGS, _FORMULA, _NUMBERS, _STRING, _TEXT = 0x0A, 0x3C, 0x85, 0xFC, 0x06, 0xBD, 0x207, 0xFD
_BEGIN = 0x809
_OF_BOOK = frozenset((_BEGIN, 0x22, 0x2F, 0x42, 0xE0, 0x41E))
"""Kept as they are: versions, dates, passwords, code page, formats."""
_OF_CELL = frozenset((0x203, 0x204, 0x205, 0x27E, _NUMBERS, _TEXT, _FORMULA))
_VALUE = 20  # bytes of a formula before its expression
_MOST_SHEETS = 256


@dataclass(slots=True)
class Sizes:
    """What a workbook's cells take: those from each sheet's first to its last, those that hold something, and text."""

    cells: int = 0
    filled: int = 0
    text: int = 0
    longest: int = field(default=0)
    """Letters of the longest string that cells may share."""


def rewritten(data: bytes) -> tuple[bytes, Sizes]:
    """Return an xls with nothing in it but cells, and what they take.

    Raises
    ------
    Damage
        If it cannot be walked.
    """
    stream = stream_of(data, ("Workbook", "Book"))
    sizes = Sizes()
    book, sheets = _book(stream, sizes)
    pages = [_page(stream, at, sizes) for at, _ in sheets]
    head = len(b"".join(book)) + sum(4 + len(rest) + 4 for _, rest in sheets) + 4
    bounds = []
    for (_, rest), page in zip(sheets, pages, strict=True):
        bounds.append(_record(_SHEET, struct.pack("<I", head) + rest))
        head += len(page)
    return container_of(b"".join([*book, *bounds, _record(_EOF, b""), *pages])), sizes


def _records(stream: bytes, at: int) -> Iterator[tuple[int, bytes]]:
    """Yield kind and content of the records from a byte on, up to the end that is marked."""
    while at + 4 <= len(stream):
        kind, length = struct.unpack_from("<HH", stream, at)
        if at + 4 + length > len(stream):
            raise Damage(f"a record at byte {at} of the workbook ends behind it")
        if kind == _EOF:
            return
        yield kind, stream[at + 4 : at + 4 + length]
        at += 4 + length
    raise Damage("its records have no end")


def _record(kind: int, content: bytes) -> bytes:
    return struct.pack("<HH", kind, len(content)) + content


def _book(stream: bytes, sizes: Sizes) -> tuple[list[bytes], list[tuple[int, bytes]]]:
    """Return the records that concern all sheets, and where each sheet begins, with the rest of what is said of it."""
    kept: list[bytes] = []
    sheets: list[tuple[int, bytes]] = []
    strings: list[bytes] = []
    before = 0
    for kind, content in _records(stream, 0):
        if kind in _OF_BOOK:
            kept.append(_record(kind, content))
        elif kind == _SHEET and len(content) > 6:
            sheets.append((struct.unpack_from("<I", content)[0], content[4:]))
        elif kind == _STRINGS or (kind == _CONTINUE and before == _STRINGS):
            strings.append(content)
            kept.append(_record(kind, content))
        before = before if kind == _CONTINUE else kind
    if len(sheets) > _MOST_SHEETS:
        raise Damage(f"{len(sheets)} sheets")
    sizes.longest = _longest(strings) if strings else 0
    return kept, sheets


def _page(stream: bytes, at: int, sizes: Sizes) -> bytes:
    """Return the cells of a sheet; of a formula its value alone."""
    kept: list[bytes] = []
    rows = columns = 0
    for kind, content in _records(stream, at):
        if kind in _OF_CELL and len(content) >= 6:
            row, column = struct.unpack_from("<HH", content)
            filled = (len(content) - 6) // 6 if kind == _NUMBERS else 1
            rows, columns = max(rows, row + 1), max(columns, column + filled)
            sizes.filled += filled
            sizes.text += sizes.longest if kind == _TEXT else 0
            kept.append(_record(kind, content[:_VALUE] + b"\0\0" if kind == _FORMULA else content))
        elif kind in (_BEGIN, _STRING):
            kept.append(_record(kind, content))
    sizes.cells += rows * columns
    return b"".join([*kept, _record(_EOF, b"")])


def _longest(records: Sequence[bytes]) -> int:
    """Return the letters of the longest string that cells share.

    A string that goes on in the next record begins there with a byte that says how wide its letters are.
    """
    if len(records[0]) < 8:
        raise Damage("a table of strings without a count")
    (count,) = struct.unpack_from("<I", records[0], 4)
    if 3 * count > sum(map(len, records)):
        raise Damage(f"a table of {count} strings in {sum(map(len, records))} bytes")
    part, at, longest = 0, 8, 0
    for _ in range(count):
        if at >= len(records[part]):
            part, at = part + 1, 0
        if part >= len(records) or at + 3 > len(records[part]):
            raise Damage("a table of strings that ends early")
        letters, flags = struct.unpack_from("<HB", records[part], at)
        longest, at = max(longest, letters), at + 3
        behind = 0
        for flag, form in ((0x8, "<H"), (0x4, "<I")):
            if flags & flag:
                if at + struct.calcsize(form) > len(records[part]):
                    raise Damage("a table of strings that ends early")
                behind += struct.unpack_from(form, records[part], at)[0] * (4 if flag == 0x8 else 1)
                at += struct.calcsize(form)
        wide = 1 + (flags & 1)
        while letters:
            taken = min(letters, (len(records[part]) - at) // wide)
            letters, at = letters - taken, at + taken * wide
            if letters:
                part, at = part + 1, 1
                if part >= len(records) or not records[part]:
                    raise Damage("a table of strings that ends early")
                wide = 1 + (records[part][0] & 1)
        at += behind
        while part < len(records) and at > len(records[part]):
            at, part = at - len(records[part]), part + 1
    return longest
