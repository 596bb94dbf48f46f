"""Vernier's Logger Pro and Graphical Analysis: CSV, and the files that the programs save.

In the CSV, runs are side by side under ``Latest: Position (m)`` or ``Data Set 1:Time(s)``. A saved file is XML (cmbl)
or a tar archive with XML (gambl): a ``DataSet`` is a run, and a ``DataColumn`` has its name, its unit and a line for
each number in ``ColumnCells``; an empty line, or ``Z1 1:``, is a lost sample.
"""

from __future__ import annotations

import io
import re
import tarfile
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from acquisition.errors import FormatError
from acquisition.recordings.tables.contents import (
    Channel,
    Contents,
    Heading,
    is_time,
    name_and_unit,
    numbered_apart,
    split_heading,
)
from acquisition.recordings.tables.markup import MOST_BYTES, read_markup, side_by_side
from acquisition.recordings.tables.sheet import ColumnFormat, headed_format
from acquisition.recordings.tables.text import head_lines, parse_number

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

__all__ = ["FORMAT"]

_OF_RUN = re.compile(r"(?P<run>[^:]+):\s*(?P<quantity>.+)")
_ROOT = re.compile(r"\s*(?:<\?xml[^>]*>\s*)?<(?:Document|udm)[\s>]")
_TAR = slice(257, 262), b"ustar"
_REMEDY = 'in Logger Pro "File", "Export As", "CSV"; in Graphical Analysis "Export", "CSV"'


def _headings(line: str) -> tuple[tuple[Heading, ...], str]:
    cells, mark = split_heading(line)
    matches = [match for cell in cells if (match := _OF_RUN.fullmatch(cell))]
    if len(matches) < 2 or len(matches) != len(cells):
        return (), mark
    headings = tuple(Heading(*name_and_unit(each["quantity"]), each["run"].strip()) for each in matches)
    known = any(is_time(each.name) for each in headings) or all(each.unit for each in headings)
    return (headings, mark) if known else ((), mark)


def _why(headings: tuple[Heading, ...], mark: str) -> str:  # noqa: ARG001
    return f'headings in line 1 begin with a run, "{headings[0].run}: "'


def _is_tar(head: bytes) -> bool:
    return head[_TAR[0]] == _TAR[1] and b".udm" in head


def _evidence(head: bytes) -> str:
    if _is_tar(head):
        return "it is a tar archive with a .udm file, as Graphical Analysis saves"
    if _ROOT.match("\n".join(head_lines(head))) and (b"Vernier" in head or b"<DataSet>" in head):
        return "it is XML with the root <Document>, by Vernier"
    return _CSV.evidence(head)


def _contents(path: str, data: bytes) -> Contents:
    if _is_tar(data[:8192]):
        return _of_markup(path, _unpacked(path, data))
    if _CSV.evidence(data[:8192]):
        return _CSV.contents(path, data)
    return _of_markup(path, data)


def _unpacked(path: str, data: bytes) -> bytes:
    try:
        with tarfile.open(fileobj=io.BytesIO(data), mode="r:") as archive:
            for each in archive:
                file = archive.extractfile(each) if each.isreg() and each.name.endswith(".udm") else None
                if file is not None and each.size <= MOST_BYTES:
                    return file.read()
    except (tarfile.TarError, EOFError, ValueError) as error:
        raise FormatError(path, f"cannot be unpacked ({error})", _REMEDY) from error
    raise FormatError(path, f"expected a .udm file of at most {MOST_BYTES} bytes in the archive, got none", _REMEDY)


def _of_markup(path: str, data: bytes) -> Contents:
    root = read_markup(path, data, _REMEDY)
    sets = [each for each in root.iter("DataSet") if each.find("DataColumn") is not None]
    runs = numbered_apart([(each.findtext("DataSetName") or "").strip() or "Data Set" for each in sets])
    by_run = [(run, list(_channels(each, run))) for run, each in zip(runs, sets, strict=True)]
    filled = [(run, channels) for run, channels in by_run if channels]
    if not filled:
        raise FormatError(path, "expected columns with numbers, got none", _REMEDY)
    return Contents(tuple(each for _, channels in filled for each in channels))


def _channels(data_set: Element, run: str) -> Iterator[Channel]:
    columns = []
    for each in data_set.iter("DataColumn"):
        cells = (each.findtext("ColumnCells") or "").strip("\n").split("\n")
        numbers = [parse_number(cell.strip()) for cell in cells]
        if any(number is not None for number in numbers):
            name, unit = ((each.findtext(tag) or "").strip() for tag in ("DataObjectName", "ColumnUnits"))
            columns.append((name, unit.strip("()"), np.array([np.nan if x is None else x for x in numbers])))
    names = numbered_apart([name for name, _, _ in columns])
    named = [(name, unit, values) for name, (_, unit, values) in zip(names, columns, strict=True)]
    yield from side_by_side(named, [at for at, (name, _, _) in enumerate(columns) if is_time(name)], run)


_TITLE = "Logger Pro, Graphical Analysis: CSV, or saved as cmbl or gambl"
_CSV = headed_format("logger-pro", _TITLE, _headings, _why, '"Latest: Position (m)"')
FORMAT = ColumnFormat("logger-pro", _TITLE, _evidence, _contents)
