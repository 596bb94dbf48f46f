"""Vernier: what Logger Pro and Graphical Analysis save or export, as XML (cmbl, gambl), CSV and Vernier Format 2 text.

What is easy to get wrong:

- Vernier Format 2: line 2 is a title, line 3 the name of the data set. Then come long names, short names and units, or,
  from small programs, only long names and units, or headings with units in brackets. Further data sets follow, each
  with its name and headings.
- CSV: runs are side by side under ``Latest: Position (m)`` or ``Data Set 1:Time(s)``.
- Logger Pro (cmbl) and Graphical Analysis (gambl, a tar archive): a ``DataSet`` is a run, and a ``DataColumn`` has its
  name, its unit and a line for each number in ``ColumnCells``; an empty line, or ``Z1 1:``, is a lost sample.
"""

from __future__ import annotations

import io
import re
import tarfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from acquisition.errors import FormatError
from acquisition.recordings.families.markup import MOST_XML_BYTES, begins, numbers_of, read_markup, tables_of
from acquisition.recordings.tables.format import text_format
from acquisition.recordings.tables.headings import Heading, headings_of, is_time, name_and_unit, split_heading, unique
from acquisition.recordings.tables.numbers import parse_number
from acquisition.recordings.tables.table import Header, Table
from acquisition.recordings.tables.text import HEAD_BYTES, Text

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

_LOGGER_PRO = re.compile(r"(?P<run>[^:]+):\s*(?P<quantity>.+)")
_FORMAT_2 = "Vernier Format 2"
_ROOT = re.compile(r"\s*(?:<\?xml[^>]*>\s*)?<(?:Document|udm)[\s>]")
_EXPORT = 'in Logger Pro "File", "Export As", "CSV"; in Graphical Analysis "Export", "CSV"'
_MOST_HEADINGS, _MOST_LINES = 3, 40


def logger_pro(lines: Sequence[str]) -> Header | None:
    """Read headings that begin with a run."""
    cells, mark = split_heading(lines[0])
    matches = [match for cell in cells if (match := _LOGGER_PRO.fullmatch(cell))]
    if len(matches) < 2 or len(matches) != len(cells):
        return None
    headings = [Heading(*name_and_unit(each["quantity"]), each["run"].strip()) for each in matches]
    if not any(is_time(each.name) for each in headings) and not all(each.unit for each in headings):
        return None
    return Header(f'headings in line 1 begin with a run, "{headings[0].run}: "', 1, mark, headings)


def vernier(lines: Sequence[str]) -> Header | None:
    """Read the title and the headings of the first data set."""
    if not lines[0].lstrip().startswith(_FORMAT_2):
        return None
    title = lines[1].strip() if len(lines) > 1 else ""
    below = _data_set(lines[2:])
    why = f'line 1 is "{_FORMAT_2}"'
    if below is None:
        return Header(why, len(lines), "\t", [], title=title)
    run, count, headings = below
    return Header(why, 2 + count, "\t", headings, run=run, title=title)


def _data_set(lines: Sequence[str]) -> tuple[str, int, list[Heading]] | None:
    """Return the name of a data set, the number of lines above its rows, and its headings; None if no rows follow."""
    above: list[str] = []
    for at, line in enumerate(lines):
        if not line.strip(" ").strip():
            continue
        cells = [cell.strip() for cell in line.strip().split("\t")]
        numbers = [parse_number(cell) is not None for cell in cells]
        if above and any(numbers) and all(number or not cell for number, cell in zip(numbers, cells, strict=True)):
            run = above[0].strip() if "\t" not in above[0].strip() else ""
            names = above[1 if run else 0 :]
            return (run, at, _vernier_headings(names)) if 1 <= len(names) <= _MOST_HEADINGS else None
        above.append(line)
        if len(above) == _MOST_LINES:
            return None
    return None


def _vernier_headings(lines: Sequence[str]) -> list[Heading]:
    """Combine long names with units; the units are in the last of two or three lines."""
    names = [cell.strip() for cell in lines[0].rstrip().split("\t")]
    if len(lines) == 1:
        return headings_of(names)
    units = [cell.strip().strip("()") for cell in lines[-1].split("\t")]
    return [Heading(name, unit) for name, unit in zip(names, [*units, *[""] * len(names)], strict=False)]


def _vernier_sets(text: Text, first: Header) -> Iterator[tuple[int, Header]]:
    """Yield further data sets: each repeats the line of long names, below its own name or below all lines of a file."""
    names = [at for at in range(2, min(first.lines, len(text))) if text.line(at).strip()]
    if not names:
        return
    long_names = names[1 if first.run and len(names) > 1 else 0]
    line = text.data[text.starts[long_names] : text.starts[long_names + 1]].rstrip(b"\n")
    rows = first.lines
    for again in text.matching(re.compile(b"^" + re.escape(line), re.MULTILINE), rows):
        begin = text.words_above(rows, again)
        head = text.head(_MOST_LINES, begin)
        skip = next((at + 2 for at, line in enumerate(head[:_MOST_HEADINGS]) if line.startswith(_FORMAT_2)), 0)
        below = _data_set(head[skip:])
        if begin <= rows or below is None:
            return
        yield begin, Header(first.why, skip + below[1], "\t", below[2], run=below[0])
        rows = again


def _is_tar(head: bytes) -> bool:
    return head[257:262] == b"ustar" and b".udm" in head


def _evidence(head: bytes) -> str:
    if _is_tar(head):
        return "it is a tar archive with a .udm file, as Graphical Analysis saves"
    if begins(head, _ROOT) and (b"Vernier" in head or b"<DataSet>" in head):
        return "it is XML with the root <Document>, by Vernier"
    return ""


def _tables(path: str, data: bytes) -> list[Table]:
    root = read_markup(path, _unpacked(path, data) if _is_tar(data[:HEAD_BYTES]) else data, _EXPORT)
    sets = [each for each in root.iter("DataSet") if each.find("DataColumn") is not None]
    taken: set[str] = set()
    runs = [unique((each.findtext("DataSetName") or "").strip() or "Data Set", taken) for each in sets]
    tables = [table for run, each in zip(runs, sets, strict=True) for table in _of_set(each, run)]
    if not tables:
        raise FormatError(path, "expected columns with numbers, got none", _EXPORT)
    return tables


def _unpacked(path: str, data: bytes) -> bytes:
    try:
        with tarfile.open(fileobj=io.BytesIO(data), mode="r:") as archive:
            for each in archive:
                file = archive.extractfile(each) if each.isreg() and each.name.endswith(".udm") else None
                if file is not None and each.size <= MOST_XML_BYTES:
                    return file.read()
    except (tarfile.TarError, EOFError, ValueError) as error:
        raise FormatError(path, f"cannot be unpacked ({error})", _EXPORT) from error
    raise FormatError(path, f"expected a .udm file of at most {MOST_XML_BYTES} bytes in the archive, got none", _EXPORT)


def _of_set(data_set: Element, run: str) -> list[Table]:
    columns = []
    for each in data_set.iter("DataColumn"):
        values = numbers_of((each.findtext("ColumnCells") or "").strip("\n").split("\n"))
        if np.isfinite(values).any():
            name, unit = ((each.findtext(tag) or "").strip() for tag in ("DataObjectName", "ColumnUnits"))
            columns.append((Heading(name, unit.strip("()")), values))
    return tables_of(columns, run)


VERNIER = text_format(
    "vernier", "Vernier Format 2 text of Logger Pro", vernier, expected=f'"{_FORMAT_2}" in line 1', blocks=_vernier_sets
)
_TITLE = "Logger Pro, Graphical Analysis: CSV, or saved as cmbl or gambl"
_TEXT = text_format("logger-pro", _TITLE, logger_pro, expected='headings like "Latest: Position (m)"')
LOGGER_PRO = replace(
    _TEXT,
    evidence=lambda head: _evidence(head) or _TEXT.evidence(head),
    tables=lambda path, data: (_tables if _evidence(data[:HEAD_BYTES]) else _TEXT.tables)(path, data),
)
