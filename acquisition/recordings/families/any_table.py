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
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import zip_longest

import numpy as np

from acquisition.recordings.recording import FormatIssue
from acquisition.recordings.tables.blocks import FEWEST_ROWS
from acquisition.recordings.tables.format import text_format
from acquisition.recordings.tables.headings import Heading, headings_of, is_time, role_of, split_heading
from acquisition.recordings.tables.layout import (
    are_named_times,
    are_row_numbers,
    columns_of,
    find_table,
    is_aside,
    times_by_name,
    times_by_steps,
    wrong_commas,
)
from acquisition.recordings.tables.numbers import is_lost, is_quantity, parse_number, quantity
from acquisition.recordings.tables.table import Header
from acquisition.recordings.tables.text import Text, decode, joined_in_turn
from acquisition.recordings.tables.times import clock_s, clock_times, is_newest_first, is_time_cell
from acquisition.recordings.tables.vocabulary import LABEL

_MONITOR = re.compile(
    r"^\[?(?:\d{1,4}[-./]\d{1,2}[-./]\d{1,4}[T ]+)?(\d{1,2}:\d\d:\d\d(?:[.,]\d{1,9})?)(?:[^\S\n]*->|\])[^\S\n]*",
    re.MULTILINE,
)
_MATRIX_ROW = re.compile(rb"^[-+.,\deE \t\[]*[;\]][ \t\];]*$", re.MULTILINE)
_BLANKED = bytes.maketrans(b"[];", b"   ")
_FEWEST, _SHARE, _HEAD, _MOST_WORDS, _FEWEST_LONG, _MOST_LONG = 3, 0.8, 40, 20, 20, 5


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
    headings, words = list(table.headings), _words(table)
    for at in words:  # rows of several sensors may have the same times
        of_one = [row for row in table.rows if row[at] == table.rows[0][at]]
        columns = columns_of(of_one) if len(of_one) >= _FEWEST else columns
    times, formula, traps = times_by_name(table, columns), table.formula, list(table.traps)
    clocks = [at for at, cells in enumerate(zip(*table.rows, strict=True)) if _are_clocks(cells)]
    unread = "" if times or formula is not None else _unread_times(table, clocks)
    if not times and formula is None and clocks:
        # Of several clocks one may be the same in all rows.
        clock = max(clocks, key=lambda at: (len({row[at] for row in table.rows}) > 1, is_time(headings[at].name), -at))
        for at in clocks:
            headings[at] = replace(headings[at], unit="s")
        times, unread, first = [clock], "", table.rows[0][clock]
        if clock_s(first) and not is_newest_first(clock_times([row[clock].encode() for row in table.rows])[0]):
            traps.append(FormatIssue("clock_times", f"the file gives times of day; here time 0 is {first}"))
    bare = not table.named and table.lines == 0 and all(parse_number(cell) is not None for cell in table.rows[0])
    # A single column besides row numbers contains measured values, even if it rises.
    numbered = bare and len(columns) > 1 and are_row_numbers(columns[0])
    if not times and formula is None and not unread and not (bare and len(columns) <= 1 + numbered):
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
        run="Part 1",  # if there are several
        ragged=len(values) > 1,
        traps=tuple(traps),
        clocks=tuple(clocks) if not formula and set(times) <= set(clocks) else (),
        words=tuple(words),
        unread_times=unread,
        refused=(problem, remedy) if wrong_commas(table) else None,
    )


def _are_clocks(cells: Sequence[str]) -> bool:
    """Return whether the cells of a column are times of day or durations, and no numbers."""
    filled = [cell for cell in cells if cell and not is_lost(cell)]
    return bool(filled) and all(parse_number(cell) is None and is_time_cell(cell) for cell in filled[:_FEWEST])


def _unread_times(table: Header, clocks: Sequence[int]) -> str:
    """Return what is wrong with a column that is named as times and is none; empty if there is no such column."""
    for at, each in enumerate(table.headings):
        if at not in clocks and are_named_times(each):
            cells = [row[at] for row in table.rows if row[at]]
            if cells and parse_number(cells[0]) is None:
                return f'the times in column "{each.name}" cannot be read, the first is "{cells[0][:40]}"'
    return ""


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


def _words(table: Header) -> list[int]:
    """Return the columns of words that may be units, or the names of sensors: a few words, each of them often."""
    words = []
    for at, cells in enumerate(zip(*table.rows, strict=True)):
        filled = {cell for cell in cells if cell}
        name = re.findall(r"[^\W\d_]+", table.headings[at].name.lower())
        labels = name and LABEL.issuperset(name) and all(cell.isdecimal() for cell in filled)
        plain = all(parse_number(cell) is None and not is_time_cell(cell) for cell in filled)
        if filled and (plain or labels) and len(filled) <= min(_MOST_WORDS, len(cells) // 2):
            words.append(at)
    return words


def without_monitor(text: Text) -> Text:
    """Return a text in which the clock times that a serial monitor writes before each line are the first column.

    They are left out where the lines begin with clock times of their own, each with another.
    """
    if not _MONITOR.search(decode(text.data[: 1 << 16])):
        return text
    lines = decode(text.data)
    stamped = len(_MONITOR.findall(lines))
    if stamped < max(2, _SHARE * len(re.findall(r"^.*\S", lines, re.MULTILINE))):
        return text
    messages = [line for line in _MONITOR.sub("", lines[: 1 << 16]).split("\n") if line.strip()]
    marks = Counter(next((mark for mark in "\t;," if mark in line), " ") for line in messages)
    mark = marks.most_common(1)[0][0] if marks else " "
    first = (line.split(mark)[0].strip(' "') for line in messages)
    own = [cell for cell in first if is_time_cell(cell)]
    known = len(own) >= _SHARE * len(messages) and len({*own}) == len(own)
    return Text.of(_MONITOR.sub("" if known else rf"\1{mark}", lines).encode())


def prepared(text: Text) -> Text:
    """Return a text as rows: without a serial monitor's clock, and with the lines joined that come in turn.

    A sketch may print the time on one line and the values on the next. The line numbers stay as they are. The brackets
    and semicolons of a matrix of MATLAB become blanks.
    """
    text = _with_units_apart(_as_columns(without_monitor(text)))
    head = text.head(_HEAD)
    if 2 * sum(line.rstrip().endswith(";") for line in head) > len(head):
        text = Text.of(_MATRIX_ROW.sub(lambda row: row[0].translate(_BLANKED), text.data))
        head = text.head(_HEAD)
    mark = next((mark for mark in "\t;," if any(mark in line for line in head)), " ")
    lines = text.lines()
    joined = joined_in_turn(lines, lambda line: _width(line, mark), mark)
    return text if joined is lines else Text.of("\n".join([*joined, ""] if text.ended else joined).encode())


def _as_columns(text: Text) -> Text:
    """Return a text of a few long lines, each a quantity, as columns; any other text as it is."""
    filled = [line for line in text.lines(0, 3 * _MOST_LONG) if line.strip()]
    lines = [line for line in filled if not line.lstrip().startswith(("#", "%"))]
    if not 0 < len(lines) <= _MOST_LONG or len(text) > 3 * _MOST_LONG:
        return text
    plain = [re.sub(r"^\s*\w+\s*=", "", line).strip(" []{};\t") for line in lines]
    mark = next((mark for mark in "\t;," if mark in plain[0]), None)
    rows = [split_heading(line.strip(f"{mark} "), mark)[0] if mark else line.split() for line in plain]
    full = rows[:-1] or rows  # the last line of a head is cut
    numbers = [cell for row in full for cell in row[1:]]
    if min(map(len, full)) < _FEWEST_LONG or any(
        parse_number(cell) is None and not is_time_cell(cell) for cell in numbers
    ):
        return text
    above = [line for line in filled if line not in lines]
    columns = ["\t".join(cells) for cells in zip_longest(*rows, fillvalue="")]
    return Text.of("\n".join([*above, *columns, ""]).encode())


def _with_units_apart(text: Text) -> Text:
    """Return a text in which the units that cells have behind their numbers are cells of their own."""
    head = [line for line in text.head(_HEAD) if any(char.isdigit() for char in line)]
    mark = next((mark for mark in "\t;," if all(mark in line for line in head[1:])), None)
    if mark is None and len({pair[1] for line in text.lines() if (pair := quantity(line.strip()))}) > 1:
        mark = "\t"  # of single cells, each with the unit that suits it
    if mark is None or len(head) < 2 * _FEWEST:
        return text
    with_unit = [[is_quantity(cell.strip(' "')) for cell in line.split(mark)] for line in head[_FEWEST:]]
    apart = {at for at, kinds in enumerate(zip_longest(*with_unit, fillvalue=False)) if np.mean(kinds) >= _SHARE}
    if not apart or 1 < len(apart) == len(with_unit[0]):  # a sketch prints one distance in several units
        return text
    lines = []
    for line in text.lines():
        cells = line.split(mark)
        for at in sorted(apart & {*range(len(cells))}, reverse=True):
            cells[at : at + 1] = quantity(cells[at].strip(' "')) or (cells[at], "")
        lines.append(mark.join(cells))
    return Text.of("\n".join(lines).encode())


def _blocks(text: Text, first: Header) -> Iterator[tuple[int, Header]]:
    """Yield where the names of a table without times come again; then each block is a run."""
    if not first.named or first.formula is not None or any(role_of(each) == "time" for each in first.headings):
        return
    names = next(line for line in reversed(text.lines(0, first.lines)) if line.strip())
    again = list(text.matching(re.compile(b"^%s$" % re.escape(names.encode()), re.MULTILINE), first.lines))
    if again and again[-1] - first.lines >= FEWEST_ROWS * len(again):
        for number, at in enumerate(again, 2):
            begin = text.words_above(first.lines, at)
            yield begin, replace(first, lines=at + 1 - begin, run=f"Part {number}", traps=())


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
    blocks=_blocks,
)
