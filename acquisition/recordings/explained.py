"""Show how a recording is read: the text above its rows, and the meaning and first cells of each column."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from acquisition.errors import FormatError
from acquisition.recordings.base import read_bytes, read_head
from acquisition.recordings.identify import get_format, sniff
from acquisition.recordings.tables.contents import Arrays, Channel, Sheet, split_heading
from acquisition.recordings.tables.sheet import ColumnFormat

__all__ = ["Column", "Layout", "explain"]

_FIRST_ROWS = 4


@dataclass(frozen=True, slots=True)
class Column:
    """One column: its name, its unit, its interpretation, and the text of its first cells."""

    name: str
    unit: str
    meaning: str
    cells: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Layout:
    """One table of a file.

    Parameters
    ----------
    runs : tuple of str
        Names of the runs in the table; the name of an unnamed run is an empty text.
    above : tuple of (int, str)
        Line number and text of each line above the rows: preamble, names, units.
    first_line : int or None
        Line number of the first row; None for a file that is not text.
    columns : tuple of Column
    """

    runs: tuple[str, ...]
    above: tuple[tuple[int, str], ...]
    first_line: int | None
    columns: tuple[Column, ...]


def explain(path: str | os.PathLike[str]) -> tuple[str, str, tuple[Layout, ...]]:
    """Return the family of a file, the evidence for it, and its tables.

    Raises
    ------
    FormatError
        If the file cannot be read, or its family has no columns.
    """
    name = os.fspath(path)
    family = sniff(path)
    reader = get_format(family)
    # MotionSensor.vi uses pairs of files; each of them has columns like any table.
    columns_of = reader if isinstance(reader, ColumnFormat) else get_format("table")
    if not isinstance(columns_of, ColumnFormat):
        raise FormatError(name, f"expected a format with columns, got {family}", "leave out the explanation of columns")
    contents = columns_of.contents(name, read_bytes(path))
    why = getattr(reader, "evidence", columns_of.evidence)(read_head(path))
    return family, why, tuple(_layouts(contents.channels))


def _layouts(channels: Sequence[Channel]) -> Iterator[Layout]:
    sheets: dict[int, list[Channel]] = {}
    for each in channels:
        key = (
            hash(("arrays", each.run)) if isinstance(each.source, Arrays) else id(each.source.text) + each.source.start
        )
        sheets.setdefault(key, []).append(each)
    ended = 0
    for own in sheets.values():
        runs = tuple(dict.fromkeys(each.run for each in own))
        source = own[0].source
        if isinstance(source, Arrays):
            yield Layout(runs, (), None, tuple(_of_arrays(own)))
            continue
        begin = ended if source.text.start < ended <= source.start else source.text.start
        number = source.first_line - sum(1 for line in source.text.lines(begin) if line.start < source.start)
        lines = [line for line in source.text.lines(begin, number) if line.start < source.start]
        above = tuple((line.number, line.text) for line in lines if line.text.strip())
        yield Layout(runs, above, source.first_line, tuple(_of_sheet(source, own)))
        ended = source.stop


def _of_sheet(sheet: Sheet, channels: Sequence[Channel]) -> Iterator[Column]:
    rows = [
        split_heading(line.text, sheet.delimiter)[0] if sheet.delimiter else line.text.split()
        for line, _ in zip(sheet.text.lines(sheet.start), range(_FIRST_ROWS), strict=False)
    ]
    times = {each.time: each.time_unit for each in channels if each.time is not None}
    own = {each.column: each for each in channels}
    width = max([len(sheet.names), *(len(row) for row in rows), *(column + 1 for column in own)])
    for column in range(width):
        cells = tuple(row[column] if column < len(row) else "" for row in rows)
        name = sheet.names[column] if column < len(sheet.names) else ""
        each = own.get(column)
        if column in times:
            yield Column(name, times[column], "time", cells)
        elif each is None:
            yield Column(name, "", "ignored", cells)
        else:
            yield Column(each.name, each.unit, _meaning(each), cells)


def _of_arrays(channels: Sequence[Channel]) -> Iterator[Column]:
    shown_times = set()
    for each in channels:
        source = each.source
        if isinstance(source, Arrays):
            if source.t is not None and source.time_name not in shown_times:
                shown_times.add(source.time_name)
                first = tuple(f"{x:.6g}" for x in source.t[:_FIRST_ROWS])
                yield Column(source.time_name, each.time_unit, "time", first)
            yield Column(each.name, each.unit, _meaning(each), tuple(f"{x:.6g}" for x in source.values[:_FIRST_ROWS]))


def _meaning(channel: Channel) -> str:
    meaning = "read only if it is named" if channel.aside else "channel"
    return (
        f"{meaning}, times {channel.formula.start_s:g} s + i * {channel.formula.step_s:g} s"
        if channel.formula
        else meaning
    )
