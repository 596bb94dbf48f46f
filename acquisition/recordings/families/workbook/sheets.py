"""Workbooks, xlsx and xls (python-calamine): every sheet with rows of numbers is a run.

The cells of a sheet go through the readers of text, one line a row, one tab between cells. What a careless reader
would get wrong:

- Cells are binary numbers without decimals. Each column is printed with as many as its longest number has of the
  fifteen digits that a workbook shows, so that none looks cut.
- A time of the day or a date is a cell of its own kind.
- A sheet of two cells, one of them in the last row and the last column, takes half a terabyte, and cells may share a
  string of any length: sizes are bounded before they are believed. An xls is written anew for that
  (:mod:`acquisition.recordings.families.workbook.biff`).
"""

from __future__ import annotations

import datetime
import io
import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

from acquisition.errors import FormatError
from acquisition.recordings.families.workbook.biff import Sizes, rewritten
from acquisition.recordings.families.workbook.compound import MAGIC, Damage
from acquisition.recordings.foreign import named
from acquisition.recordings.parts import contents_of_parts, members
from acquisition.recordings.tables.contents import Contents
from acquisition.recordings.tables.sheet import ColumnFormat

__all__ = ["FORMAT"]

_ZIP = b"PK\x03\x04"
_MOST_BYTES = 1 << 27
_MOST_CELLS = 1 << 23
_EMPTY_CELLS, _PER_FILLED = 1 << 20, 8  # of which so many, or so many for each that is filled, may be empty
_MOST_TEXT = 1 << 27
_DIGITS = 15  # a workbook shows and computes no more
_MOST_DECIMALS = 12
_REMEDY = "export the sheet as CSV"
_CELL = re.compile(rb'<(?:\w+:)?(row|c)\b(?:[^>]*?\br="([A-Z]{0,9})(\d{1,9})")?')
_SHARES = re.compile(rb'\bt="s"')
_SHARED_END = re.compile(rb"</(?:\w+:)?si>")
_SHEET = re.compile(r"xl/worksheets/[^/]*\.xml", re.IGNORECASE)
_BLANK = str.maketrans("\t\r\n", "   ")


def _evidence(head: bytes) -> str:
    if head.startswith(MAGIC):
        return "it begins with the bytes of an OLE file, as xls does"
    sheets = b"[Content_Types].xml" in head or b"xl/" in head
    return "it is a zip archive with the parts of an xlsx" if head.startswith(_ZIP) and sheets else ""


def _contents(path: str, data: bytes) -> Contents:
    if data.startswith(_ZIP):
        _demand_bounded(path, _xlsx_sizes(path, data))
    else:
        data, sizes = _rewritten(path, data)
        _demand_bounded(path, sizes)
    return contents_of_parts(path, _sheets(path, data), "sheet")


def _demand_bounded(path: str, sizes: Sizes) -> None:
    """Demand that the sheets take no more cells and no more text than they may."""
    most = min(_MOST_CELLS, max(_EMPTY_CELLS, _PER_FILLED * sizes.filled))
    if sizes.cells > most:
        raise FormatError(path, f"expected sheets of at most {most} cells, got {sizes.cells}", _REMEDY)
    if sizes.text > _MOST_TEXT:
        raise FormatError(path, f"expected at most {_MOST_TEXT} letters in cells, got {sizes.text}", _REMEDY)


def _rewritten(path: str, data: bytes) -> tuple[bytes, Sizes]:
    """Return an xls with its cells alone, and their sizes."""
    if len(data) > _MOST_BYTES:
        raise FormatError(path, f"expected a workbook of at most {_MOST_BYTES} bytes, got {len(data)}", _REMEDY)
    try:
        return rewritten(data)
    except Damage as error:
        raise named(path, b"") or FormatError(path, f"is no xls that can be read ({error})", _REMEDY) from error


def _xlsx_sizes(path: str, data: bytes) -> Sizes:
    """Return what the cells of an xlsx take."""
    sizes = Sizes()
    sheets, shares = False, 0
    for name, page in members(path, data, _MOST_BYTES):
        if name.lower() == "xl/sharedstrings.xml":
            ends = [0, *(found.end() for found in _SHARED_END.finditer(page)), len(page)]
            sizes.longest = max(b - a for a, b in pairwise(ends))
        if not _SHEET.fullmatch(name):
            continue
        sheets = True
        if b"\0" in page:
            raise FormatError(path, f"expected UTF-8 in {name}, got something else", _REMEDY)
        row = column = rows = columns = 0
        for found in _CELL.finditer(page):
            if found[1] == b"row":
                row, column = int(found[3] or row + 1), 0
            else:
                sizes.filled += 1
                column = _number(found[2]) if found[2] else column + 1
                row = max(row, int(found[3] or 0))
            rows, columns = max(rows, row), max(columns, column)
        sizes.cells += rows * columns
        shares += len(_SHARES.findall(page))
    if not sheets:
        demand = "expected the sheets of an xlsx workbook, got none"
        raise FormatError(path, demand, "save it as xlsx or CSV in the program that made it")
    sizes.text = sizes.longest * shares
    return sizes


def _number(letters: bytes) -> int:
    """Return the number of a column by its letters, A being 1."""
    number = 0
    for letter in letters:
        number = 26 * number + letter - 64
    return number


def _sheets(path: str, data: bytes) -> Iterator[tuple[str, bytes]]:
    """Yield name and text of every sheet."""
    from python_calamine import CalamineWorkbook

    try:
        book = CalamineWorkbook.from_object(io.BytesIO(data))
        for name in book.sheet_names:
            sheet = book.get_sheet_by_name(name)
            yield name, _text(sheet.to_python(skip_empty_area=False))
    except FormatError:
        raise
    except BaseException as error:
        # calamine has errors of its own for damage, and Rust's panic, which is no Exception, for what it overlooked.
        if isinstance(error, (KeyboardInterrupt, SystemExit, GeneratorExit, MemoryError)):
            raise
        reason = " ".join(str(error).split()) or type(error).__name__
        raise named(path, b"") or FormatError(path, f"calamine cannot read it ({reason[:200]})", _REMEDY) from error


def _text(rows: Sequence[Sequence[Any]]) -> bytes:
    columns = [_printed(column) for column in zip(*rows, strict=True)]
    return "\n".join("\t".join(row) for row in zip(*columns, strict=True)).encode("utf-8", "replace") + b"\n"


def _printed(column: Sequence[Any]) -> list[str]:
    """Print the cells of a column, its numbers with as many decimals as the longest of them needs."""
    numbers = [f"{cell:.{_DIGITS}g}" for cell in column if _is_number(cell)]
    decimals = max((len(each.partition(".")[2]) for each in numbers if "e" not in each), default=0)
    fixed = decimals <= _MOST_DECIMALS and not any("e" in each for each in numbers)
    form = f".{decimals}f" if fixed else f".{_DIGITS - 1}e"
    return [format(cell, form) if _is_number(cell) else _word(cell) for cell in column]


def _is_number(cell: object) -> bool:
    """Tell a number; an xls keeps whole ones apart."""
    return isinstance(cell, (int, float)) and not isinstance(cell, bool)


def _word(cell: object) -> str:
    if isinstance(cell, datetime.timedelta):
        return f"{cell.total_seconds():g}"
    if isinstance(cell, (datetime.datetime, datetime.time)):
        return cell.isoformat(*([" "] if isinstance(cell, datetime.datetime) else []))
    return "" if cell is None else str(cell).translate(_BLANK).strip()


FORMAT = ColumnFormat(
    "workbook", "workbook, xlsx or xls: every sheet with rows of numbers is a run", _evidence, _contents
)
