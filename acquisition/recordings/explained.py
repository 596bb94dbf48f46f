"""Show how a recording is read: the text above its rows, and the meaning and first cells of each column."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from acquisition.errors import FormatError
from acquisition.recordings.base import read_bytes
from acquisition.recordings.identify import get_format, sniff
from acquisition.recordings.tables.format import ColumnFormat
from acquisition.recordings.tables.table import Column, Lines, Table, names_apart
from acquisition.recordings.tables.text import Text, is_text

_FIRST_ROWS = 4


@dataclass(frozen=True, slots=True)
class ColumnRole:
    """One column: its name, its unit, its interpretation, and the text of its first cells."""

    name: str
    unit: str
    meaning: str
    cells: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Explanation:
    """The rows of some runs: the number and text of each line above them, and their columns.

    ``first_line`` is the line number of the first row; None for a file that is not text.
    """

    runs: tuple[str, ...]
    above: tuple[tuple[int, str], ...]
    first_line: int | None
    columns: tuple[ColumnRole, ...]


def explain(path: str | os.PathLike[str]) -> tuple[str, str, tuple[Explanation, ...]]:
    """Return the family of a file, the evidence for it, and its rows."""
    name, family, data = os.fspath(path), sniff(path), read_bytes(path)
    reader = get_format(family)
    # MotionSensor.vi uses pairs of files; each of them has columns like any table.
    format_of_columns = reader if isinstance(reader, ColumnFormat) else get_format("table")
    if not isinstance(format_of_columns, ColumnFormat):
        raise FormatError(name, f"expected a format with columns, got {family}", "leave out the explanation of columns")
    tables = names_apart(format_of_columns.tables(name, data))
    why = getattr(reader, "evidence", format_of_columns.evidence)(data[:8192])
    return family, why, tuple(_explained(tables, data))


def _explained(tables: Sequence[Table], data: bytes) -> Iterator[Explanation]:
    ended = 0
    by_rows: dict[int, list[Table]] = {}
    for each in tables:
        by_rows.setdefault(id(each.lines or each), []).append(each)
    for own in by_rows.values():
        lines, above = own[0].lines, ()
        if lines is not None and is_text(data):
            text = Text.of(data).lines()
            above = tuple((each.number, each.text) for each in text if ended < each.number < lines.first)
            above = tuple(each for each in above if each[1].strip())
            ended = lines.line(lines.rows - 1)
        runs = tuple(dict.fromkeys(each.run for each in own))
        yield Explanation(runs, above, lines and lines.first, tuple(_roles(own, lines)))


def _roles(tables: Sequence[Table], lines: Lines | None) -> Iterator[ColumnRole]:
    channels = {id(column.values): (column, each) for each in tables for column in each.columns}
    times = {id(each.times.values): each.times for each in tables if each.times is not None}
    for at, column in enumerate(tables[0].beside or [*times.values(), *(each for each, _ in channels.values())]):
        key = id(column.values)
        cells = _cells(column) if lines is None else tuple(row[at] if at < len(row) else "" for row in lines.cells)
        if key in channels:
            own, table = channels[key]
            yield ColumnRole(own.name, own.unit, _meaning(own, table), cells)
        elif key in times:
            yield ColumnRole(column.name, times[key].unit, "time", cells)
        else:
            yield ColumnRole(column.name, "", "ignored", cells)


def _cells(column: Column) -> tuple[str, ...]:
    return tuple(f"{value:.6g}" for value in column.values[:_FIRST_ROWS])


def _meaning(column: Column, table: Table) -> str:
    meaning = "read only if it is named" if column.aside else "channel"
    formula = table.formula
    return meaning if formula is None else f"{meaning}, times {formula.start_s:g} s + i * {formula.step_s:g} s"
