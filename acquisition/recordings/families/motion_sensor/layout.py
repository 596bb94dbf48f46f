"""Find title, column line, first row, quantity and unit of a MotionSensor.vi file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Literal, NamedTuple

from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.questions import Missing, MissingItem, Question
from acquisition.recordings.tables.cells import parse_number
from acquisition.recordings.tables.headings import guess_delimiter, is_time, name_and_unit, split_cells
from acquisition.recordings.tables.text import Line, Text
from acquisition.recordings.units import LENGTHS

Quantity = Literal["distance", "velocity"]

_TITLE, _TIME = "motion sensor data file", "time (s)"
_DISTANCE = {f"distance ({unit})": unit for unit in LENGTHS}
_ERROR = {f"{name} error ({unit})": unit for unit in LENGTHS for name in ("dist", "distance")}
_VELOCITY = {f"velocity ({unit}/s)": unit for unit in LENGTHS}
_CHANNELS: dict[str, Quantity] = {"distance": "distance", "position": "distance", "velocity": "velocity"}
_HEADER_LINES = 20
_ROWS_BELOW, _ROWS_OF_SHAPE = 10, 100  # number of rows to examine with and without a column line
_REMEDY = 'put the column line "Time (s)<TAB>Distance (cm)" or "Time (s)<TAB>Velocity (cm/s)" above the rows'


class Layout(NamedTuple):
    """The title of a file and the meaning of its columns.

    A row has ``columns`` cells: time, the quantity, and, if there are three, its error. ``unit`` is a length, "cm" also
    for velocities in cm/s. ``assumed`` is the meaning that the rows or the user indicate if there is no column line.
    """

    quantity: Quantity
    columns: int
    unit: str
    assumed: str = ""
    title: str = ""


def evidence(lines: Sequence[str]) -> str:
    """Return why the first lines of a text belong to a MotionSensor.vi file; empty if they do not."""
    for number, line in enumerate(lines[:_HEADER_LINES], 1):
        if _is_title(line):
            return f'line {number} is the title "{line.strip()}"'
    if layout := _column_line(lines):
        return f"line {layout[0] + 1} is the column line of {layout[1].quantity} in {layout[1].unit}"
    start = _first_row(lines[:2])
    shape = _shape(lines[start:]) if start >= 0 and not (start and _names_others(*lines[:2])) else None
    return f"the rows have the shape of {shape.assumed}" if shape else ""


def find_layout(path: str, text: Text, channel: str | None, unit: str | None) -> tuple[Layout, Line, str]:
    """Return the meaning of the rows, the first row, and the separator of cells; ask for the meaning if it is open."""
    head = text.head(_HEADER_LINES + _ROWS_BELOW)
    lines = [line.text for line in head]
    if channel is not None and channel.lower() not in _CHANNELS:
        raise FormatError(path, f'channel must be distance or velocity, got "{channel}"', "name one of these")
    wanted = None if channel is None else _CHANNELS[channel.lower()]
    if not (column_line := _column_line(lines)):
        head = text.head(_HEADER_LINES + _ROWS_OF_SHAPE)
        lines = [line.text for line in head]
    if column_line:
        at, layout = column_line
        if unit is not None and _plain(unit) != layout.unit:
            problem = f'unit must be {layout.unit} as stated by the column line, got "{unit}"'
            raise FormatError(path, problem, "leave the unit out", line=at + 1)
        start, title = at + 1, " / ".join(line.strip() for line in lines[:at] if line.strip())
    else:
        start = _first_row(lines)
        titled = any(_is_title(line) for line in lines[:_HEADER_LINES])
        if start < 0:
            raise _no_rows(path, lines, "rows of two or three numbers")
        layout = _by_shape(path, lines[start:], titled, wanted, start + 1)
        if unit is not None:
            if _plain(unit) not in LENGTHS:
                raise FormatError(path, f'unit must be one of {", ".join(LENGTHS)}, got "{unit}"', "name one of these")
            layout = layout._replace(unit=_plain(unit))
        title, start = _title_and_start(lines, start)
    if wanted and wanted != layout.quantity:
        problem = f'channel must be {layout.quantity}, which the file holds, got "{channel}"'
        raise FormatError(path, problem, "leave the channel out or name the other file")
    rows = [line for line in lines[start:] if line.strip()]
    if not rows:
        raise _no_rows(path, lines, "rows of numbers below the column line")
    delimiter = next((guess_delimiter(row) for row in rows if _is_row(row)), guess_delimiter(rows[0]))
    return layout._replace(title=title), head[start], delimiter


def no_column_line(path: str, got: str, line: int | None = None) -> FormatError:
    """Return the error for rows that need a column line."""
    return FormatError(path, f"expected a column line that names the columns, got {got}", _REMEDY, line=line)


def _no_rows(path: str, lines: Sequence[str], problem: str) -> FormatError:
    return FormatError(path, f"expected {problem}, got none", "check that the export ended", line=max(len(lines), 1))


def _column_line(lines: Sequence[str]) -> tuple[int, Layout] | None:
    """Find the column line above the first row."""
    if not any(_TIME in line.lower() for line in lines[:_HEADER_LINES]):
        return None
    for at, line in enumerate(lines[:_HEADER_LINES]):
        if _is_row(line):
            return None
        cells = [cell.strip().lower() for cell in split_cells(line, guess_delimiter(line) or "\t")]
        if 2 <= len(cells) <= 3 and cells[0] == _TIME:
            if (unit := _VELOCITY.get(cells[1])) and len(cells) == 2:
                return at, Layout("velocity", 2, unit)
            if (unit := _DISTANCE.get(cells[1])) and (len(cells) == 2 or _ERROR.get(cells[2]) == unit):
                return at, Layout("distance", len(cells), unit)
    return None


def _names_others(above: str, row: str) -> bool:
    """Return whether a line names all columns of the row below it, in words that this family does not use."""
    mark = guess_delimiter(row)
    names = split_cells(above.lstrip("\ufeff#% "), mark)
    return len(names) == len(split_cells(row, mark)) and (bool(mark) or is_time(name_and_unit(names[0])[0]))


def _is_title(line: str) -> bool:
    return line.lstrip().lower().startswith(_TITLE)


def _numbers(line: str) -> list[float | None]:
    return [parse_number(cell) for cell in split_cells(line, guess_delimiter(line))]


def _is_row(line: str) -> bool:
    numbers = _numbers(line)
    return len(numbers) >= 2 and None not in numbers


def _first_row(lines: Sequence[str]) -> int:
    return next((at for at, line in enumerate(lines[:_HEADER_LINES]) if _is_row(line)), -1)


def _title_and_start(lines: Sequence[str], row: int) -> tuple[str, int]:
    """Return the title, which is line 1 unless that is or looks like a damaged row, and the index of the first row."""
    if row == 0 or (not _is_title(lines[0]) and _begins_with_number(lines[0])):
        return "", 0
    return lines[0].strip(), 1


def _begins_with_number(line: str) -> bool:
    cells = split_cells(line, guess_delimiter(line))
    return bool(cells) and parse_number(cells[0]) is not None


def _shape(lines: Sequence[str]) -> Layout | None:
    """Infer the layout from the rows alone: a constant third column is the error, an initial NaN means velocity."""
    every = [_numbers(line) for line in lines[:_ROWS_OF_SHAPE] if line.strip()]
    rows = [[x for x in row if x is not None] for row in every if None not in row]
    three, two = ([row for row in rows if len(row) == n] for n in (3, 2))
    if len(three) >= 3 and len(three) > len(two):
        third = [row[2] for row in three]
        usual = max(set(third), key=third.count)
        if usual > 0 and third.count(usual) >= 0.95 * len(third) and _times_run(three):
            return Layout("distance", 3, "cm", "distance and its error, because the third column is constant")
    elif (
        len(two) >= 3 and rows[0] == two[0] and math.isnan(two[0][1]) and not math.isnan(two[1][1]) and _times_run(two)
    ):
        return Layout("velocity", 2, "cm", "velocity, because the first value is NaN")
    return None


def _times_run(rows: Sequence[Sequence[float]]) -> bool:
    forward = sum(a[0] < b[0] for a, b in pairwise(rows))
    return rows[0][0] >= 0 and forward >= 0.5 * (len(rows) - 1)


def _by_shape(path: str, rows: Sequence[str], titled: bool, wanted: Quantity | None, line: int) -> Layout:
    if layout := _shape(rows):
        return layout
    columns = len(_numbers(rows[0]))
    if columns == 2 and wanted:
        return Layout(wanted, 2, "cm", f"{wanted}, as stated by the user")
    got = f"{columns} columns" + (" under the title" if titled else "")
    if columns != 2:
        raise no_column_line(path, got, line)
    need = MissingItem(Missing.CHANNEL, ("distance", "velocity"), "distance")
    reason = f"no column line names the columns, got {got}"
    raise NeedsAnswer(Question(path, (need,), reason=reason), line=line)


def _plain(unit: str) -> str:
    return unit.strip().removesuffix("/s")
