"""Workbooks, xlsx and xls (python-calamine): every sheet with rows of numbers is a run.

The cells of a sheet go through the readers of text, one line a row, one tab between cells. What a careless reader
would get wrong:

- Cells are binary numbers without decimals. Each column is printed with as many as its longest number has of the
  fifteen digits that a workbook shows, so that none looks cut.
- A time of the day or a date is a cell of its own kind.
- A sheet of two cells, one of them in the last row and the last column, takes half a terabyte: sizes are bounded before
  they are believed.
"""

from __future__ import annotations

import datetime
import io
import re
from collections.abc import Iterator, Sequence
from typing import Any

from acquisition.errors import FormatError
from acquisition.recordings.foreign import named
from acquisition.recordings.parts import contents_of_parts, members
from acquisition.recordings.tables.contents import Contents
from acquisition.recordings.tables.sheet import ColumnFormat

__all__ = ["FORMAT"]

_ZIP, _OLE = b"PK\x03\x04", bytes.fromhex("d0cf11e0a1b11ae1")
_MOST_BYTES = 1 << 27
_MOST_CELLS = 1 << 23
_DIGITS = 15  # a workbook shows and computes no more
_MOST_DECIMALS = 12
_REMEDY = "export the sheet as CSV"
_CELL = re.compile(rb'<(?:\w+:)?(row|c)\b(?:[^>]*?\br="([A-Z]{0,9})(\d{1,9})")?')
_SHEET = re.compile(r"xl/worksheets/[^/]*\.xml", re.IGNORECASE)
_BLANK = str.maketrans("\t\r\n", "   ")


def _evidence(head: bytes) -> str:
    if head.startswith(_OLE):
        return "it begins with the bytes of an OLE file, as xls does"
    sheets = b"[Content_Types].xml" in head or b"xl/" in head
    return "it is a zip archive with the parts of an xlsx" if head.startswith(_ZIP) and sheets else ""


def _contents(path: str, data: bytes) -> Contents:
    if data.startswith(_ZIP):
        _demand_bounded(path, data)
    elif len(data) > _MOST_BYTES:
        raise FormatError(path, f"expected a workbook of at most {_MOST_BYTES} bytes, got {len(data)}", _REMEDY)
    return contents_of_parts(path, _sheets(path, data), "sheet")


def _demand_bounded(path: str, data: bytes) -> None:
    """Demand that no sheet has more cells from its first to its last than it may."""
    cells = 0
    sheets = False
    for name, page in members(path, data, _MOST_BYTES):
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
                column = _number(found[2]) if found[2] else column + 1
                row = max(row, int(found[3] or 0))
            rows, columns = max(rows, row), max(columns, column)
        cells += rows * columns
    if not sheets:
        demand = "expected the sheets of an xlsx workbook, got none"
        raise FormatError(path, demand, "save it as xlsx or CSV in the program that made it")
    if cells > _MOST_CELLS:
        raise FormatError(path, f"expected sheets of at most {_MOST_CELLS} cells, got {cells}", _REMEDY)


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
            size = 0 if sheet.end is None else (sheet.end[0] + 1) * (sheet.end[1] + 1)
            if size > _MOST_CELLS:
                raise FormatError(path, f"expected sheets of at most {_MOST_CELLS} cells, got {size}", _REMEDY)
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
    numbers = [f"{cell:.{_DIGITS}g}" for cell in column if isinstance(cell, float)]
    decimals = max((len(each.partition(".")[2]) for each in numbers if "e" not in each), default=0)
    fixed = decimals <= _MOST_DECIMALS and not any("e" in each for each in numbers)
    form = f".{decimals}f" if fixed else f".{_DIGITS - 1}e"
    return [format(cell, form) if isinstance(cell, float) else _word(cell) for cell in column]


def _word(cell: object) -> str:
    if isinstance(cell, datetime.timedelta):
        return f"{cell.total_seconds():g}"
    if isinstance(cell, (datetime.datetime, datetime.time)):
        return cell.isoformat(*([" "] if isinstance(cell, datetime.datetime) else []))
    return "" if cell is None else str(cell).translate(_BLANK).strip()


FORMAT = ColumnFormat(
    "workbook", "workbook, xlsx or xls: every sheet with rows of numbers is a run", _evidence, _contents
)
