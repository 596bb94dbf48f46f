"""LVM: LabVIEW Measurement files.

A file header, which ends with ``***End_of_Header***``, states the separator of cells and the kind of times. Then come
segments: a segment header, which also ends with ``***End_of_Header***``, a line with the names of the channels, and
rows. What is easy to get wrong:

- The separator is the character after the word ``Separator``. ``Decimal_Separator`` may be absent; the decimal mark is
  detected in each cell.
- ``X_Columns`` No: the first cell of a row is empty and t = X0 + i Delta_X. One: the first column is t. Multi: a
  column of times precedes each channel.
- Headers may be outdated: more or fewer rows than ``Samples``, or a step other than ``Delta_X``. If the column of times
  agrees with the formula within its rounding, the formula is more accurate and is used; otherwise the column is used.
- Channels of one segment may have different lengths; a comment column may follow.
- A loop may write a segment in each pass. If each goes on where the one before it ends, all are offered as one run.
- A date in 1903 or 1904 is LabVIEW's zero of time and not a start time.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from acquisition.errors import FormatError
from acquisition.recordings.sampling.timing import Formula
from acquisition.recordings.tables.format import ColumnFormat
from acquisition.recordings.tables.headings import name_and_unit
from acquisition.recordings.tables.numbers import parse_number
from acquisition.recordings.tables.rows import read_rows
from acquisition.recordings.tables.table import Column, Table
from acquisition.recordings.tables.text import Text, decode, is_text, text_of

_MAGIC = "LabVIEW Measurement"
_END = "***End_of_Header***"
_END_MARK = re.compile(re.escape(_END).encode())
_SEPARATOR = "Separator"
_MOST_HEADER_LINES = 500
_MOST_SEGMENTS = 10_000
_DECIMALS = 9  # of times that are computed from headers


@dataclass(frozen=True, slots=True, eq=False)
class _Header:
    """The keys of a header with their cells, and the index of the line after it."""

    cells: Mapping[str, list[str]]
    next: int

    def of_column(self, key: str, column: int) -> str:
        """Return the cell of a key that belongs to a column of the rows, counted from 1; empty if there is none."""
        return "".join(self.cells.get(key, [])[column - 1 : column])

    def get(self, key: str, column: int = 1) -> str:
        """Return the cell of a key that belongs to a column, or else the first that is not empty."""
        return self.of_column(key, column) or next(filter(None, self.cells.get(key, ())), "")


def _evidence(head: bytes) -> str:
    if is_text(head) and decode(head).lstrip().startswith(_MAGIC):
        return f'line 1 begins with "{_MAGIC}"'
    return ""


def _tables(path: str, data: bytes) -> list[Table]:
    text = text_of(path, data)
    lines = text.head(_MOST_HEADER_LINES)
    if not lines or not lines[0].lstrip().startswith(_MAGIC):
        raise FormatError(path, f'expected "{_MAGIC}" in the first line', "check that this is an LVM file", line=1)
    tag = re.compile(rf"\s*{_SEPARATOR}([^\w])")
    # The separator is the character after its tag, or else after the opening words of line 1.
    separators = (match[1] for line in lines if (match := tag.match(line)))
    mark = next(separators, lines[0].lstrip()[len(_MAGIC) :][:1]) or "\t"
    top = _header(path, text, 0, mark)
    segments = list(_segments(path, text, top, mark))
    passes: list[list[Table]] = []
    for number, (segment, stop) in enumerate(segments, 1):
        run = f"Segment {number}" if len(segments) > 1 else ""
        passes.append(list(_of_segment(path, text, top, segment, stop, mark, run)))
    tables = [*_joined(passes), *(each for of_pass in passes for each in of_pass)]
    if not tables:
        raise FormatError(path, "expected channels below the header, got none", "export the run again")
    title = segments[0][0].get("Notes") or top.get("Description")
    return [replace(each, title=title) for each in tables]


def _header(path: str, text: Text, first: int, mark: str) -> _Header:
    """Read the lines of a header up to its end mark."""
    cells: dict[str, list[str]] = {}
    for at, line in enumerate(text.lines(first, _MOST_HEADER_LINES + 1), first):
        key, *values = [cell.strip() for cell in line.split(mark)]
        if key == _END:
            return _Header(cells, at + 1)
        if key:
            cells.setdefault(key, values)
    problem = f"expected {_END} within {_MOST_HEADER_LINES} lines, got none"
    raise FormatError(path, problem, "check that the export ended", line=first + 1)


def _segments(path: str, text: Text, top: _Header, mark: str) -> Iterator[tuple[_Header, int]]:
    """Yield each segment's header and the index of the line after its rows."""
    start = top.next
    for _ in range(_MOST_SEGMENTS):
        header = _header(path, text, start, mark)
        end = next(text.matching(_END_MARK, header.next), None)
        if end is None:
            yield header, len(text)
            return
        start = text.words_above(header.next, end)
        yield header, start
    raise FormatError(path, f"expected at most {_MOST_SEGMENTS} segments", "split the file")


def _of_segment(
    path: str, text: Text, top: _Header, segment: _Header, stop: int, mark: str, run: str
) -> Iterator[Table]:
    """Yield a table for each channel in a segment's line of names; its header may state times of each channel."""
    if segment.next >= stop:
        return
    cells = [cell.strip() for cell in text.line(segment.next).split(mark)]
    while cells and not cells[-1]:
        cells.pop()
    if cells and cells[-1] == "Comment":
        cells.pop()
    table = read_rows(path, text, segment.next + 1, stop, mark)
    none = Column("", "", np.empty(0), np.empty(0, np.int8))
    read = [*table.columns, *[none] * (len(cells) - len(table.columns))]
    beside = tuple(replace(column, name=name) for name, column in zip(cells, read, strict=False))
    mode = (top.get("X_Columns") or "One").lower()
    for at in range(1, len(cells), 2 if mode == "multi" else 1):
        name, unit = _name_and_unit(cells[at], segment.of_column("Y_Unit_Label", at), at)
        timed = (segment.get("X_Dimension", at) or "Time") == "Time"
        time = None if mode == "no" or not timed else beside[at - 1 if mode == "multi" else 0]
        aside = segment.of_column("Samples", at) == "0"
        yield replace(
            table,
            columns=(replace(beside[at], name=name, unit=unit, aside=aside),),
            times=None if time is None else replace(time, unit="s"),
            formula=_formula(segment, at) if timed else None,
            run=run,
            start_time=_start_time(segment, at),
            ragged=True,
            beside=beside,
        )


def _joined(passes: list[list[Table]]) -> list[Table]:
    """Return the tables of all segments as one run, if they have the same channels and each segment runs on."""
    labels = [[table.columns[0].label for table in of_pass] for of_pass in passes]
    if len(passes) < 2 or any(each != labels[0] or not each for each in labels):
        return []
    if not all(_runs_on(before[0], after[0]) for before, after in pairwise(passes)):
        return []
    tables = []
    for parts in zip(*passes, strict=True):
        lines = [part.lines for part in parts if part.lines is not None]
        tables.append(
            replace(
                parts[0],
                columns=(_end_to_end([each.columns[0] for each in parts]),),
                times=_end_to_end([_times(each) for each in parts]),
                formula=None,
                run=f"Segments 1 to {len(parts)}",
                lines=lines[-1]._replace(
                    numbers=np.concatenate([each.numbers for each in lines]),
                    words=np.concatenate([each.words for each in lines]),
                ),
                beside=tuple(_end_to_end(list(each)) for each in zip(*(part.beside for part in parts), strict=True)),
            )
        )
    return tables


def _times(table: Table) -> Column:
    """Return the times of a segment, from its header if it has no column of them."""
    if table.times is not None:
        return table.times
    start_s, step_s = (0.0, math.nan) if table.formula is None else (table.formula.start_s, table.formula.step_s)
    t = start_s + step_s * np.arange(table.columns[0].values.size)
    return Column("X_Value", "s", np.round(t, _DECIMALS), np.full(t.size, _DECIMALS, np.int8))


def _runs_on(before: Table, after: Table) -> bool:
    """Return whether a segment begins behind the segment before it, after at most half of its length."""
    t, begin = _times(before).values, _times(after).values[:1]
    if len(before.beside) != len(after.beside) or t.size < 2 or not begin.size:
        return False
    return bool(0.0 < begin[0] - t[-1] < max(0.5, 2.5 / (t.size - 1)) * (t[-1] - t[0]))  # false for a NaN


def _end_to_end(parts: list[Column]) -> Column:
    return replace(
        parts[0],
        values=np.concatenate([part.values for part in parts]),
        decimals=np.concatenate([part.forms for part in parts]),
    )


def _name_and_unit(label: str, unit: str, column: int) -> tuple[str, str]:
    """Split a channel's label into name and unit, unless the header states a different unit."""
    name, inside = name_and_unit(label)
    if inside and unit in ("", inside):
        return name, inside
    return label or f"Column {column}", unit


def _formula(segment: _Header, column: int) -> Formula | None:
    start, step, samples = (parse_number(segment.get(key, column)) for key in ("X0", "Delta_X", "Samples"))
    if step is None:
        return None
    count = None if samples is None or not 0 <= samples < 2**53 else int(samples)
    return Formula(0.0 if start is None else start, step, count)


def _start_time(segment: _Header, column: int) -> str:
    date, time = (segment.get(key, column) for key in ("Date", "Time"))
    day = re.fullmatch(r"(\d{4})/(\d\d)/(\d\d)", date, re.ASCII)
    if day is None or int(day[1]) <= 1904:
        return ""
    start = "-".join(day.groups())
    clock = re.match(r"(\d\d:\d\d:\d\d)(?:[.,](\d{1,6}))?", time, re.ASCII)
    if clock is None:
        return start
    return f"{start}T{clock[1]}.{clock[2]}" if clock[2] else f"{start}T{clock[1]}"


FORMAT = ColumnFormat(
    "lvm", "LVM: LabVIEW Measurement text, any separator, every kind of X_Columns", _evidence, _tables
)
