"""Workbooks, xlsx and xls (python-calamine): every sheet with rows of numbers is a run.

Cells are binary numbers. Each column is printed as text with one number of decimals, enough for the fifteen digits that
a workbook shows, and the text is read like a file. A workbook of a few bytes can make calamine reserve any amount of
memory, and crash its process if there is not enough, so calamine runs in a child process with limits of time and
memory.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys

from acquisition.errors import FormatError
from acquisition.recordings.families import workbook_child
from acquisition.recordings.families.archive import NOT_INSIDE, members, tables_inside
from acquisition.recordings.identify import foreign_format
from acquisition.recordings.tables.format import ColumnFormat
from acquisition.recordings.tables.table import Table
from acquisition.recordings.tables.text import ZIP_MAGIC

MOST_WORKBOOK_BYTES = 1 << 27
"""Maximum size of a workbook, bytes."""
MOST_LETTERS = 1 << 27
"""Maximum number of characters of all cells."""
MEMORY_BYTES = 1 << 30
"""Memory limit of the child process, bytes: a million rows of three columns take 600 MB."""
TIME_LIMIT_S = 60.0
"""Time limit of the child process: a million rows of three columns take 10 s on a laptop of 2020."""

_OLE = bytes.fromhex("d0cf11e0a1b11ae1")
_NO_VALUE = re.compile(rb"</f>\s*(?:<v\s*/>|<v>\s*</v>|</c>)")
_FEWEST_FORMULAS = 10
_REMEDY = "export the sheet as CSV"


def _evidence(head: bytes) -> str:
    if head.startswith(_OLE):
        return "it begins with the bytes of an OLE file, as xls does"
    sheets = b"[Content_Types].xml" in head or b"xl/" in head
    return "it is a zip archive with the parts of an xlsx" if head.startswith(ZIP_MAGIC) and sheets else ""


def _tables(path: str, data: bytes) -> list[Table]:
    if len(data) > MOST_WORKBOOK_BYTES:
        raise FormatError(path, f"expected a workbook of at most {MOST_WORKBOOK_BYTES} bytes, got {len(data)}", _REMEDY)
    _refuse_formulas(path, data)
    return tables_inside(path, _sheets(path, data), "sheet", (*NOT_INSIDE, "sketch"))


def _refuse_formulas(path: str, data: bytes) -> None:
    """Refuse a workbook whose formulas have no values, because no spreadsheet has opened it yet."""
    if not data.startswith(ZIP_MAGIC):
        return
    for name, part in members(path, data):
        if name.startswith("xl/worksheets/") and (count := len(_NO_VALUE.findall(part))) >= _FEWEST_FORMULAS:
            problem = f"expected numbers, got {count} formulas without values in {name.rpartition('/')[2]}"
            raise FormatError(path, problem, "open it in a spreadsheet and save it")


def _sheets(path: str, data: bytes) -> list[tuple[str, bytes]]:
    """Return the name of every sheet and its cells as text between tabs, as read by the child process."""
    # With -P the folder of the script is not searched for modules. subprocess also works inside a worker of a pool.
    command = [sys.executable, "-P", workbook_child.__file__, str(MEMORY_BYTES), str(MOST_LETTERS)]
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
    return [(name, text.encode("utf-8", "replace")) for name, text in answer["sheets"]]


FORMAT = ColumnFormat(
    "workbook", "workbook, xlsx or xls: every sheet with rows of numbers is a run", _evidence, _tables
)
