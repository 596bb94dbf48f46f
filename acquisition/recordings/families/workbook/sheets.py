"""Workbooks, xlsx and xls (python-calamine): every sheet with rows of numbers is a run.

The cells of a sheet are passed to the readers of text, with one line per row and one tab between cells. Three things
differ from text:

- Cells are binary numbers without printed decimals. Each column is printed with as many decimals as its longest number
  needs for the fifteen digits that a workbook shows, so that no number looks incomplete.
- Times of day and dates are separate types of cells.
- A file of a few bytes can make calamine reserve any amount of memory, and crash its process if there is not enough.
  The file may state any size, have one cell in the last row and column, or share one long string among many cells. So
  stated sizes are checked first, and calamine runs in a child process with limits of time and memory.
"""

from __future__ import annotations

import re
import struct
import sys
from itertools import islice

from acquisition.errors import FormatError
from acquisition.recordings.families.workbook import child
from acquisition.recordings.foreign import foreign_format
from acquisition.recordings.parts import contents_of_parts, members
from acquisition.recordings.tables.contents import Contents
from acquisition.recordings.tables.sheet import ColumnFormat

__all__ = ["FORMAT"]

MOST_BYTES = 1 << 27
"""Maximum size of an xls, or of an unpacked xlsx, bytes: a million rows of three columns take 120 MB."""
MOST_CELLS = 1 << 23
"""Maximum number of cells that the sheets may state: eight full columns of an xlsx."""
MOST_LETTERS = 1 << 27
"""Maximum number of characters of all cells as text: a million rows of three columns take 22 million."""
MEMORY_BYTES = 1 << 30
"""Memory limit of the child process, bytes: a million rows of three columns take 600 MB."""
TIME_LIMIT_S = 60.0
"""Time limit of the child process: a million rows of three columns take 10 s on a laptop of 2020."""

_ZIP = b"PK\x03\x04"
_OLE = bytes.fromhex("d0cf11e0a1b11ae1")
_REMEDY = "export the sheet as CSV"
_SHEET = re.compile(r"xl/worksheets/[^/]*\.xml", re.IGNORECASE)
_HEAD_BYTES = 1 << 14  # a sheet states its dimension in its second element
_CORNER = rb"\$?([A-Z]{1,9})\$?(\d{1,9})"
_DIMENSION = re.compile(rb'<(?:\w+:)?dimension\b[^>]*?\bref="' + _CORNER + rb"(?::" + _CORNER + rb')?"')
# The first record of a worksheet in an xls: its kind BOF, its length, the version (BIFF5 or BIFF8) and "worksheet".
_WORKSHEET = re.compile(rb"\x09\x08[\x08\x10]\x00\x00[\x05\x06]\x10\x00")
_DIMENSIONS, _SIZES = 0x200, {10: "<4H", 14: "<IIHH"}
_MOST_SHEETS, _MOST_RECORDS = 256, 512  # maximum number of sheets, and of records per sheet, to search


def _evidence(head: bytes) -> str:
    if head.startswith(_OLE):
        return "it begins with the bytes of an OLE file, as xls does"
    sheets = b"[Content_Types].xml" in head or b"xl/" in head
    return "it is a zip archive with the parts of an xlsx" if head.startswith(_ZIP) and sheets else ""


def _contents(path: str, data: bytes) -> Contents:
    cells = _cells_of_xlsx(path, data) if data.startswith(_ZIP) else _cells_of_xls(path, data)
    if cells > MOST_CELLS:
        raise FormatError(path, f"expected sheets of at most {MOST_CELLS} cells, got {cells}", _REMEDY)
    return contents_of_parts(path, _sheets(path, data), "sheet")


def _cells_of_xlsx(path: str, data: bytes) -> int:
    """Return the number of cells that the sheets of an xlsx state; only the heads of the sheets are unpacked."""
    heads = [head for name, head in members(path, data, MOST_BYTES, _HEAD_BYTES) if _SHEET.fullmatch(name)]
    if not heads:
        problem = "expected the sheets of an xlsx workbook, got none"
        raise FormatError(path, problem, "save it as xlsx or CSV in the program that made it")
    cells = 0
    for stated in filter(None, map(_DIMENSION.search, heads)):
        left, top, right, bottom = stated.groups()
        if right is not None:
            cells += max(0, int(bottom) - int(top) + 1) * max(0, _number(right) - _number(left) + 1)
    return cells


def _number(letters: bytes) -> int:
    """Return the number of a column from its letters; A is 1."""
    number = 0
    for letter in letters:
        number = 26 * number + letter - 64
    return number


def _cells_of_xls(path: str, data: bytes) -> int:
    """Return the number of cells that the sheets of an xls state (MS-XLS 2.4.90).

    A file may store its records in pieces and out of order. If a size is missed for this reason, only the limits of
    the child process apply.
    """
    if len(data) > MOST_BYTES:
        raise FormatError(path, f"expected a workbook of at most {MOST_BYTES} bytes, got {len(data)}", _REMEDY)
    cells = 0
    for worksheet in islice(_WORKSHEET.finditer(data), _MOST_SHEETS):
        at = worksheet.start()
        for _ in range(_MOST_RECORDS):
            if at + 18 > len(data):
                break
            kind, length = struct.unpack_from("<HH", data, at)
            if kind == _DIMENSIONS and length in _SIZES:
                top, bottom, left, right = struct.unpack_from(_SIZES[length], data, at + 4)
                cells += max(0, bottom - top) * max(0, right - left)
                break
            at += 4 + length
    return cells


def _sheets(path: str, data: bytes) -> list[tuple[str, bytes]]:
    """Return the name and the text of every sheet, as read by the child process."""
    import json
    import subprocess

    # With -P the folder of the script is not searched for modules. subprocess also works inside a worker of a pool.
    command = [sys.executable, "-P", child.__file__, str(MEMORY_BYTES), str(MOST_LETTERS)]
    try:
        done = subprocess.run(command, input=data, capture_output=True, timeout=TIME_LIMIT_S, check=False)
    except subprocess.TimeoutExpired as error:
        raise FormatError(path, f"expected a workbook that opens within {TIME_LIMIT_S:g} s", _REMEDY) from error
    except OSError as error:
        problem = f"the process that reads workbooks cannot be started ({error.strerror})"
        raise FormatError(path, problem, _REMEDY) from error
    if done.returncode:
        reason = done.stderr.decode("utf-8", "replace").strip().partition("\n")[0].strip()[:200] or "no message"
        problem = f"the process that reads workbooks ended with status {done.returncode} ({reason})"
        raise FormatError(path, problem, _REMEDY)
    answer = json.loads(done.stdout)
    if "refused" in answer:
        raise foreign_format(path, b"") or FormatError(
            path, f"calamine cannot read it ({answer['refused'][:200]})", _REMEDY
        )
    return [(name, text.encode()) for name, text in answer["sheets"]]


FORMAT = ColumnFormat(
    "workbook", "workbook, xlsx or xls: every sheet with rows of numbers is a run", _evidence, _contents
)
