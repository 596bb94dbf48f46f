"""Vernier's Logger Pro and Graphical Analysis: CSV, and the files that the programs save.

The CSV is in :mod:`acquisition.recordings.families.dialects`. A saved file is XML (cmbl) or a tar archive with XML
(gambl): a ``DataSet`` is a run, and a ``DataColumn`` has its name, its unit and a line for each number in
``ColumnCells``; an empty line, or ``Z1 1:``, is a lost sample.
"""

from __future__ import annotations

import io
import re
import tarfile
from typing import TYPE_CHECKING

import numpy as np

from acquisition.errors import FormatError
from acquisition.recordings.families.dialects import logger_pro
from acquisition.recordings.tables.dialect import text_format
from acquisition.recordings.tables.headings import Heading, numbered_apart
from acquisition.recordings.tables.markup import MOST_BYTES, numbers, read_markup, tables_of_markup, with_markup
from acquisition.recordings.tables.table import Table
from acquisition.recordings.tables.text import HEAD_BYTES, head_lines

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

_ROOT = re.compile(r"\s*(?:<\?xml[^>]*>\s*)?<(?:Document|udm)[\s>]")
_TAR = slice(257, 262), b"ustar"
_REMEDY = 'in Logger Pro "File", "Export As", "CSV"; in Graphical Analysis "Export", "CSV"'


def _is_tar(head: bytes) -> bool:
    return head[_TAR[0]] == _TAR[1] and b".udm" in head


def _evidence(head: bytes) -> str:
    if _is_tar(head):
        return "it is a tar archive with a .udm file, as Graphical Analysis saves"
    if _ROOT.match("\n".join(head_lines(head))) and (b"Vernier" in head or b"<DataSet>" in head):
        return "it is XML with the root <Document>, by Vernier"
    return ""


def _tables(path: str, data: bytes) -> list[Table]:
    root = read_markup(path, _unpacked(path, data) if _is_tar(data[:HEAD_BYTES]) else data, _REMEDY)
    sets = [each for each in root.iter("DataSet") if each.find("DataColumn") is not None]
    runs = numbered_apart([(each.findtext("DataSetName") or "").strip() or "Data Set" for each in sets])
    tables = [table for run, each in zip(runs, sets, strict=True) for table in _of_set(each, run)]
    if not tables:
        raise FormatError(path, "expected columns with numbers, got none", _REMEDY)
    return tables


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


def _of_set(data_set: Element, run: str) -> list[Table]:
    columns = []
    for each in data_set.iter("DataColumn"):
        values = numbers((each.findtext("ColumnCells") or "").strip("\n").split("\n"))
        if np.isfinite(values).any():
            name, unit = ((each.findtext(tag) or "").strip() for tag in ("DataObjectName", "ColumnUnits"))
            columns.append((Heading(name, unit.strip("()")), values))
    return tables_of_markup(columns, run)


FORMAT = with_markup(
    text_format(
        "logger-pro",
        "Logger Pro, Graphical Analysis: CSV, or saved as cmbl or gambl",
        logger_pro,
        expected='headings like "Latest: Position (m)"',
    ),
    _evidence,
    _tables,
)
