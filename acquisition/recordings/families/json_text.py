"""JSON: a list of records, an object of columns, or rows under the names of columns, read like a table of text."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from typing import Any

from acquisition.errors import FormatError
from acquisition.recordings.families import any_table
from acquisition.recordings.tables.format import ColumnFormat
from acquisition.recordings.tables.headings import heading_of, is_time
from acquisition.recordings.tables.table import Table
from acquisition.recordings.tables.text import head_lines, text_of

_FEWEST = 3
_BEGINS = re.compile(r'\s*(\{\s*"|\[\s*\{\s*"|\[\s*\[\s*[-"\d])')
_LISTS = re.compile(r'"([^"\n]+)"\s*(?=:\s*[\[{]\s*["\d.-]|[],])')
_ROWS = re.compile(r"\s*\[\s*\[\s*-?\d")
_NAMES = re.compile(r'"([^"\n]+)"\s*:')
_REMEDY = 'save lists of times and values, as {"t": [...], "x": [...]}'


def _evidence(head: bytes) -> str:
    text = "\n".join(head_lines(head))
    first = text.lstrip().partition("\n")[0]
    if not _BEGINS.match(text) or ("\n" in text.strip() and first.rstrip().endswith("}")):
        return ""  # a line for each record is read as a sketch's
    names = (_NAMES if re.search(r"\[\s*\{", text) else _LISTS).findall(text)
    rows = "it is JSON with rows of numbers" if _ROWS.match(text) else ""
    return next((f'it is JSON with "{name}"' for name in names if is_time(heading_of(name)[0])), rows)


def _tables(path: str, data: bytes) -> list[Table]:
    try:
        content = json.loads(text_of(path, data).data)
    except (ValueError, RecursionError) as error:
        raise FormatError(path, f"expected JSON, got {' '.join(str(error).split())}", _REMEDY) from error
    for names, columns in _columns(content, 0):
        size = max(map(len, columns), default=0)
        if size >= _FEWEST:
            cells = [[_cell(column[row]) if row < len(column) else "" for column in columns] for row in range(size)]
            lines = ["\t".join(map(_cell, names)), *("\t".join(row) for row in cells), ""]
            return list(any_table.FORMAT.tables(path, "\n".join(lines).encode()))
    raise FormatError(path, "expected lists of numbers in JSON, got none", _REMEDY)


def _columns(content: Any, depth: int) -> Iterator[tuple[Sequence[str], Sequence[Sequence[Any]]]]:
    """Yield names and columns wherever lists of one of the forms stand."""
    if isinstance(content, list) and content and all(isinstance(each, dict) for each in content):
        names = list(dict.fromkeys(name for each in content for name, cell in each.items() if _is_cell(cell)))
        yield names, [[each.get(name, "") for each in content] for name in names]
    named = {"": content} if isinstance(content, list) else content
    if not isinstance(named, dict) or depth > 8:
        return
    lists = {name: _as_list(each) for name, each in named.items()}
    names = [name for name, each in lists.items() if len(each) >= _FEWEST and all(map(_is_cell, each))]
    if len(names) > 1:
        yield names, [lists[name] for name in names]
    for rows in named.values():
        if isinstance(rows, list) and rows and all(isinstance(row, list) and len(row) == len(rows[0]) for row in rows):
            titles = next((each for each in lists.values() if len(each) == len(rows[0]) and each is not rows), [])
            yield [str(each) for each in titles] or [""] * len(rows[0]), list(zip(*rows, strict=True))
    for each in named.values() if named is content else ():
        yield from _columns(each, depth + 1)


def _as_list(value: Any) -> Sequence[Any]:
    return value if isinstance(value, list) else list(value.values()) if isinstance(value, dict) else ()


def _is_cell(value: Any) -> bool:
    return value is None or isinstance(value, str | int | float)


def _cell(value: Any) -> str:
    return "" if value is None else " ".join(str(value).split())


FORMAT = ColumnFormat("json", "JSON: lists of times and values, or a list of records", _evidence, _tables)
