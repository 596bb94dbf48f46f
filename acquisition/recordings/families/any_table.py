"""Any table: rows of numbers below any headings, from programs without a separate family.

This family is tried last. :func:`acquisition.recordings.tables.table_layout.find_table` finds the table; this module
decides which of its columns are times. What is easy to get wrong:

- A rising column is read as the times if its name denotes time, in one of a dozen languages. Otherwise a column with a
  neutral name may be the times because of its even steps, or because no other column rises. Row numbers and periods
  are not times.
- Clock times (``10:04:59.812``) are converted to seconds since the first one; midnight may lie between them.
- Oscilloscopes write ``Start`` and ``Increment`` above a column of row numbers.
"""

from __future__ import annotations

from dataclasses import replace

from acquisition.errors import FormatError
from acquisition.recordings.foreign import foreign_format
from acquisition.recordings.recording import Trap
from acquisition.recordings.tables.contents import Channel, Contents, Formula, Heading, Sheet, numbered_apart
from acquisition.recordings.tables.prefixed import without_prefix
from acquisition.recordings.tables.roles import columns_of, is_aside, times_by_name, times_by_steps
from acquisition.recordings.tables.sheet import ColumnFormat
from acquisition.recordings.tables.table_layout import TableLayout, clock_s, find_table
from acquisition.recordings.tables.text import Text, decode, is_text, parse_number, text_of
from acquisition.recordings.units import measure_of, time_power

__all__ = ["FORMAT"]

_HEAD_LINES = 300
_DAY_S = 86400.0
_BLANKS = bytes.maketrans(b"[];", b"   ")


def _evidence(head: bytes) -> str:
    if not is_text(head) or head.lstrip(b"\xef\xbb\xbf \r\n\t").startswith(b"<"):
        return ""
    if foreign_format("", head) is not None:
        return ""  # the error message will name the kind of file
    _, table = _find(Text.of(head))
    if table is None:
        return ""
    names = ", ".join(f'"{each.name}"' for each in table.headings if each.name)
    return f"numbers begin in line {table.line.number}, below {names or 'no names'}"


def _contents(path: str, data: bytes) -> Contents:
    text, table = _find(text_of(path, data))
    if table is None:
        raise FormatError(path, "expected rows of numbers, three or more alike", "check that the export ended")
    columns = columns_of(table.rows)
    headings, words = _units_beside(table)
    times, formula = times_by_name(headings, columns), _formula(table)
    traps = list(_preamble(table))
    clocks = [column for column, cell in enumerate(table.rows[0]) if clock_s(cell) and parse_number(cell) is None]
    if table.brackets:
        rows = text.data[table.line.start : text.stop].translate(_BLANKS)
        text = replace(text, data=text.data[: table.line.start] + rows + text.data[text.stop :])
    if not times and formula is None and clocks:
        text, first = _without_clock(text, table, clocks[0])
        headings[clocks[0]] = replace(headings[clocks[0]], unit="s")
        times = clocks[:1]
        traps.append(Trap("clock_times", f"the file gives times of day; here time 0 is {first}"))
    if not times and formula is None and (guess := times_by_steps(headings, columns)) is not None:
        times = [guess]
        message = f'"{_name(headings[guess], guess)}" was read as the times, because no other column rises like it'
        traps.append(Trap("time_assumed", message))
    names = numbered_apart([_name(each, column) for column, each in enumerate(headings)])
    sheet = Sheet(text, table.line.start, text.stop, table.line.number, table.mark, names=tuple(names))
    channels = []
    for column, each in enumerate(headings):
        if column in times or column in clocks or column in words or (formula is not None and column == 0):
            continue
        aside = is_aside(each, columns[column], bool(times) or len(columns) > 1)
        time = max((at for at in times if at < column), default=times[0] if times else None)
        channels.append(
            Channel(
                names[column],
                each.unit,
                sheet,
                column=column,
                time=time,
                time_unit="" if time is None else headings[time].unit,
                formula=formula,
                ragged=True,
                aside=aside,
            )
        )
    if not channels:
        raise FormatError(path, "expected a column beside the times, got none", "export what was measured too")
    if all(each.aside for each in channels):
        channels = [replace(each, aside=False) for each in channels]
    title = table.preamble[0] if table.preamble else ""
    return Contents(tuple(channels), title=title, traps=tuple(traps), zeros=text.zeros)


def _units_beside(table: TableLayout) -> tuple[list[Heading], set[int]]:
    """Return the headings, with units taken from columns of units to the right of the numbers, and these columns."""
    headings, words = list(table.headings), set()
    for column, cells in enumerate(zip(*table.rows, strict=True)):
        known = measure_of(cells[0]) is not None or time_power(cells[0]) is not None
        if column and known and parse_number(cells[0]) is None and len(set(cells)) == 1 and not headings[column].name:
            headings[column - 1] = replace(headings[column - 1], unit=headings[column - 1].unit or cells[0])
            words.add(column)
    return headings, words


def _find(text: Text) -> tuple[Text, TableLayout | None]:
    """Remove prefixes of rows from a text, and find the table in it."""
    text, headings = without_prefix(text) or (text, ())
    table = find_table(text.head(_HEAD_LINES))
    if table is not None and len(headings) == len(table.headings):
        both = zip(headings, table.headings, strict=True)
        table = replace(table, headings=tuple(Heading(a.name or b.name, a.unit or b.unit) for a, b in both))
    return text, table


def _name(heading: Heading, column: int) -> str:
    return heading.name or f"column {column + 1}"


def _preamble(table: TableLayout) -> tuple[Trap, ...]:
    if not table.preamble:
        return ()
    count = len(table.preamble)
    lines = "1 line of text above the table was" if count == 1 else f"{count} lines of text above the table were"
    message = f'{lines} skipped; the first is "{table.preamble[0][:40]}"'
    return (Trap("preamble", message, count),)


def _formula(table: TableLayout) -> Formula | None:
    """Return the times that an oscilloscope states by a start and an increment after the names; else None."""
    settings = {name.lower(): parse_number(value) for name, value in table.spare}
    start, step = settings.get("start"), settings.get("increment")
    return None if start is None or not step or not step > 0 else Formula(start, step)


def _without_clock(text: Text, table: TableLayout, column: int) -> tuple[Text, str]:
    """Replace a column of clock times by seconds since the first clock time; return the text and the first time."""
    mark = table.mark.encode() or None
    lines: list[bytes] = []
    first, last, days, shown = None, 0.0, 0, ""
    for raw in text.data[table.line.start : text.stop].splitlines(keepends=True):
        body = raw.rstrip(b"\r\n")
        cells = body.split(mark)
        cell = decode(cells[column]).strip().strip('"') if column < len(cells) else ""
        clock = clock_s(cell)
        if clock is not None:
            _, at, decimals = clock
            if first is None:
                first, last, shown = at, at, cell
            days += at < last - _DAY_S / 2
            last = at
            cells[column] = f"{at - first + days * _DAY_S:.{decimals}f}".encode()
            body = (mark or b" ").join(cells)
        lines.append(body + raw[len(raw.rstrip(b"\r\n")) :])
    rows = b"".join(lines)
    start = table.line.start
    return replace(text, data=text.data[:start] + rows + text.data[text.stop :], stop=start + len(rows)), shown


FORMAT = ColumnFormat("table", "any other table: columns of numbers below their names", _evidence, _contents)
