"""Any table: rows of numbers, with or without headings, from programs without a separate family.

This family is tried last. :func:`acquisition.recordings.tables.layout.find_table` finds the table; this module decides
which of its columns are times. What is easy to get wrong:

- A rising column is read as the times if its name denotes time, in one of a dozen languages. Otherwise a column with a
  neutral name may be the times because of its even steps, or because no other column rises. Row numbers and periods
  are not times.
- Clock times (``10:04:59.812``) are converted to seconds since the first one; midnight may lie between them.
- Oscilloscopes write ``Start`` and ``Increment`` above a column of row numbers.
- A serial monitor writes the time of day in front of each line.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from acquisition.recordings.recording import FormatIssue
from acquisition.recordings.tables.format import text_format
from acquisition.recordings.tables.headings import Heading, headings_of, is_time, split_heading
from acquisition.recordings.tables.layout import (
    are_row_numbers,
    columns_of,
    find_table,
    is_aside,
    times_by_name,
    times_by_steps,
    wrong_commas,
)
from acquisition.recordings.tables.numbers import parse_number
from acquisition.recordings.tables.table import Header
from acquisition.recordings.tables.text import Text, decode, in_turn
from acquisition.recordings.tables.times import clock_s
from acquisition.units import measure_of, time_unit

_MONITOR = re.compile(
    r"^\[?(?:\d{1,4}[-./]\d{1,2}[-./]\d{1,4}[T ]+)?(\d{1,2}:\d\d:\d\d(?:[.,]\d{1,9})?)(?:[^\S\n]*->|\])[^\S\n]*",
    re.MULTILINE,
)
_MATRIX_ROW = re.compile(rb"^[-+.,\deE \t\[]*[;\]][ \t\];]*$", re.MULTILINE)
_BLANKED = bytes.maketrans(b"[];", b"   ")
_FEWEST, _SHARE, _HEAD = 3, 0.8, 40


def header(lines: Sequence[str]) -> Header | None:
    """Find the rows of numbers, and decide which columns are times."""
    if "".join(lines).lstrip("\ufeff \r\n\t").startswith(("<", "%PDF")):
        return None
    if (headed := _headed(lines)) is not None:
        return headed
    table = find_table(tuple(lines))
    if table is None:
        return None
    # The last row may be incomplete.
    columns = columns_of(table.rows[:-1] if len(table.rows) > _FEWEST else table.rows)
    headings, words = _units_beside(table)
    times, formula, traps = times_by_name(headings, columns), table.formula, list(table.traps)
    clocks = [at for at, cell in enumerate(table.rows[0]) if clock_s(cell) and parse_number(cell) is None]
    clock = None
    if not times and formula is None and clocks:
        clock = clocks[0]
        headings[clock] = replace(headings[clock], unit="s")
        times = [clock]
        traps.append(FormatIssue("clock_times", f"the file gives times of day; here time 0 is {table.rows[0][clock]}"))
    bare = not table.named and table.lines == 0 and all(parse_number(cell) is not None for cell in table.rows[0])
    # A single column besides row numbers contains measured values, even if it rises.
    numbered = bare and len(columns) > 1 and are_row_numbers(columns[0])
    if not times and formula is None and not (bare and len(columns) <= 1 + numbered):
        guess = times_by_steps(headings, columns)
        if guess is not None:
            times = [guess]
            if guess or not bare:
                name = headings[guess].name or f"column {guess + 1}"
                message = f'"{name}" was read as the times, because no other column rises like it'
                traps.append(FormatIssue("time_assumed", message))
    ignored = {*words, *clocks} | ({0} if formula is not None or numbered else set())
    values = [at for at in range(len(headings)) if at not in ignored and at not in times]
    asides = {at for at in values if is_aside(headings[at], columns[at], bool(times) or len(columns) > 1)}
    if bare or asides.issuperset(values):
        asides = set()

    def marked(at: int, heading: Heading) -> Heading:
        if at in times:
            return replace(heading, role="time")
        return replace(heading, role="ignored" if at in ignored else "aside" if at in asides else "channel")

    count = sum(1 for each in table.headings if each.name)
    problem = f"rows have more cells than the {count} names above them, because the times have decimal commas"
    remedy = "export with semicolons between the cells, or with decimal points"
    return replace(
        table,
        headings=[marked(at, each) for at, each in enumerate(headings)],
        ragged=len(values) > 1,
        traps=tuple(traps),
        clock=clock,
        refused=(problem, remedy) if wrong_commas(table) else None,
    )


def _headed(lines: Sequence[str]) -> Header | None:
    """Read headings with units in line 1, times first: these need no rows to be certain."""
    cells, mark = split_heading(lines[0])
    headings = headings_of(cells)
    if len(headings) < 2 or not is_time(headings[0].name) or not all(each.unit for each in headings):
        return None
    cell = lines[1].split(mark)[0].strip(' "') if len(lines) > 1 else ""
    if cell and parse_number(cell) is None:
        return None
    why = f'line 1 is headings with units that begin with "{headings[0].name} ({headings[0].unit})"'
    return Header(why, 1, mark, headings)


def _units_beside(table: Header) -> tuple[list[Heading], set[int]]:
    """Return the headings, with units taken from columns of units to the right of the numbers, and these columns."""
    headings, words = list(table.headings), set()
    for column, cells in enumerate(zip(*table.rows, strict=True)):
        is_unit = measure_of(cells[0]) is not None or time_unit(cells[0]) is not None
        if column and is_unit and parse_number(cells[0]) is None and len(set(cells)) == 1 and not headings[column].name:
            headings[column - 1] = replace(headings[column - 1], unit=headings[column - 1].unit or cells[0])
            words.add(column)
    return headings, words


def without_monitor(text: Text) -> Text:
    """Return a text in which the clock times that a serial monitor writes before each line are the first column."""
    if not _MONITOR.search(decode(text.data[: 1 << 16])):
        return text
    lines = decode(text.data)
    stamped = len(_MONITOR.findall(lines))
    if stamped < max(_FEWEST, _SHARE * len(re.findall(r"^.*\S", lines, re.MULTILINE))):
        return text
    messages = [line for line in _MONITOR.sub("", lines[: 1 << 16]).split("\n") if line.strip()]
    marks = Counter(next((mark for mark in "\t;," if mark in line), " ") for line in messages)
    mark = marks.most_common(1)[0][0] if marks else " "
    return Text.of(_MONITOR.sub(rf"\1{mark}", lines).encode())


def prepared(text: Text) -> Text:
    """Return a text as rows: without a serial monitor's clock, and with the lines joined that come in turn.

    A sketch may print the time on one line and the values on the next. The line numbers stay as they are. The brackets
    and semicolons of a matrix of MATLAB become blanks.
    """
    text = without_monitor(text)
    head = text.head(_HEAD)
    if 2 * sum(line.rstrip().endswith(";") for line in head) > len(head):
        text = Text.of(_MATRIX_ROW.sub(lambda row: row[0].translate(_BLANKED), text.data))
        head = text.head(_HEAD)
    mark = next((mark for mark in "\t;," if any(mark in line for line in head)), " ")
    widths = [_width(line, mark) for line in head]
    first = in_turn(widths)
    if first is None:
        return text
    lines = text.lines()
    joined, at = lines[:first], first
    while at < len(lines):
        pair = lines[at : at + 2]
        whole = [_width(line, mark) for line in pair] == widths[first : first + 2]
        joined += [mark.join(line.strip() for line in pair), ""] if whole else pair[:1]
        at += 2 if whole else 1
    return Text.of("\n".join([*joined, ""] if text.ended else joined).encode())


def _width(line: str, mark: str) -> int:
    """Return the number of cells of a line of numbers; 0 for any other line."""
    cells = [cell for each in line.split(mark) if (cell := each.strip())]
    return len(cells) if all(parse_number(cell) is not None for cell in cells) else 0


FORMAT = text_format(
    "table",
    "any other table: columns of numbers, with or without names",
    header,
    expected="rows of numbers, three or more alike",
    prepare=prepared,
)
