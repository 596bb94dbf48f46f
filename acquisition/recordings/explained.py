"""Show how a recording is read: the text above its rows, and the meaning and first cells of each column."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from acquisition.recordings.base import read_bytes
from acquisition.recordings.identify import get_format, sniff
from acquisition.recordings.tables.format import ColumnFormat
from acquisition.recordings.tables.table import Table, names_apart
from acquisition.recordings.tables.text import HEAD_BYTES, Text, is_text


@dataclass(frozen=True, slots=True)
class ColumnRole:
    """One column: its name, its unit, its interpretation, and the text of its first cells."""

    name: str
    unit: str
    meaning: str
    cells: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Explanation:
    """The rows of some runs: the lines above them, the number of the first (None if it is no text), the columns."""

    runs: tuple[str, ...]
    above: tuple[tuple[int, str], ...]
    first_line: int | None
    columns: tuple[ColumnRole, ...]


def explain(path: str | os.PathLike[str]) -> tuple[str, str, tuple[Explanation, ...]]:
    """Return the family of a file, the evidence for it, and its rows; any table shows the columns of other formats."""
    name, family, data = os.fspath(path), sniff(path), read_bytes(path)
    reader = get_format(family)
    columns = reader if isinstance(reader, ColumnFormat) else get_format("table")
    tables = names_apart(columns.tables(name, data)) if isinstance(columns, ColumnFormat) else []
    evidence = getattr(reader, "evidence", lambda _: "")
    return family, evidence(data[:HEAD_BYTES]), tuple(_explained(tables, data))


def _explained(tables: Sequence[Table], data: bytes) -> Iterator[Explanation]:
    by_rows: dict[int, list[Table]] = {}
    for each in tables:
        by_rows.setdefault(id(each.lines or each), []).append(each)
    ended = 0
    for own in by_rows.values():
        lines, above = own[0].lines, []
        if lines is not None and is_text(data):
            above = [(line.number, line.text) for line in Text.of(data).lines() if ended < line.number < lines.first]
            ended = lines.line(lines.rows - 1)
        runs = tuple(dict.fromkeys(each.run for each in own))
        shown = tuple(each for each in above if each[1].strip())
        yield Explanation(runs, shown, lines.first if lines else None, tuple(_roles(own)))


def _roles(tables: Sequence[Table]) -> Iterator[ColumnRole]:
    channels = {id(column.values): (column, each) for each in tables for column in each.columns}
    units = {id(each.times.values): each.times.unit for each in tables if each.times is not None}
    lines = tables[0].lines
    for at, column in enumerate(tables[0].beside or tables[0].columns):
        key = id(column.values)
        printed = [f"{value:.6g}" for value in column.values[:4]]
        cells = printed if lines is None else [row[at] if at < len(row) else "" for row in lines.cells]
        name, unit, meaning = column.name, units.get(key, ""), "time" if key in units else "ignored"
        if key in channels:
            own, table = channels[key]
            name, unit, meaning = own.name, own.unit, "read only if it is named" if own.aside else "channel"
            if table.formula is not None:
                meaning += f", times {table.formula.start_s:g} s + i * {table.formula.step_s:g} s"
        yield ColumnRole(name, unit, meaning, tuple(cells))
