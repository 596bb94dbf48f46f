"""Any table: rows of numbers below whatever names them, of programs that have no family of their own.

The last to be asked. :func:`acquisition.recordings.tables.finding.find_table` says where the table is; here is said
which of its columns are times. What a careless reader would get wrong:

- A column is a time by its name, in a dozen languages, and only if it runs forward; or, where names say nothing
  against it, because it alone runs forward. Row numbers are no times, and a period is none.
- Clock times (``10:04:59.812``) count from the first; midnight may lie between them.
- Oscilloscopes write ``Start`` and ``Increment`` above a column of row numbers.
"""

from __future__ import annotations

from dataclasses import replace

from acquisition.errors import FormatError
from acquisition.recordings.foreign import named
from acquisition.recordings.recording import Trap
from acquisition.recordings.tables.contents import Channel, Contents, Formula, Heading, Sheet, numbered_apart
from acquisition.recordings.tables.finding import Found, clock_s, find_table
from acquisition.recordings.tables.prefixed import without_prefix
from acquisition.recordings.tables.roles import columns_of, is_aside, times_by_name, times_by_steps
from acquisition.recordings.tables.sheet import ColumnFormat
from acquisition.recordings.tables.text import Text, decode, is_text, parse_number, text_of
from acquisition.recordings.units import measure_of, time_power

__all__ = ["FORMAT"]

_HEAD_LINES = 300
_DAY_S = 86400.0
_BLANKS = bytes.maketrans(b"[];", b"   ")


def _evidence(head: bytes) -> str:
    if not is_text(head) or head.lstrip(b"\xef\xbb\xbf \r\n\t").startswith(b"<"):
        return ""
    if named("", head) is not None:
        return ""  # the one who refuses the file says what it is
    _, found = _find(Text.of(head))
    if found is None:
        return ""
    names = ", ".join(f'"{each.name}"' for each in found.headings if each.name)
    return f"numbers begin in line {found.line.number}, below {names or 'no names'}"


def _contents(path: str, data: bytes) -> Contents:
    text, found = _find(text_of(path, data))
    if found is None:
        raise FormatError(path, "expected rows of numbers, three or more alike", "check that the export ended")
    columns = columns_of(found.rows)
    headings, words = _units_beside(found)
    times, formula = times_by_name(headings, columns), _formula(found)
    traps = list(_preamble(found))
    clocks = [column for column, cell in enumerate(found.rows[0]) if clock_s(cell) and parse_number(cell) is None]
    if found.brackets:
        rows = text.data[found.line.start : text.stop].translate(_BLANKS)
        text = replace(text, data=text.data[: found.line.start] + rows + text.data[text.stop :])
    if not times and formula is None and clocks:
        text, first = _without_clock(text, found, clocks[0])
        headings[clocks[0]] = replace(headings[clocks[0]], unit="s")
        times = clocks[:1]
        traps.append(Trap("clock_times", f"times are of a clock and count from its first, {first}"))
    if not times and formula is None and (guess := times_by_steps(headings, columns)) is not None:
        times = [guess]
        message = f'"{_name(headings[guess], guess)}" was taken for the times: no other column runs forward alike'
        traps.append(Trap("time_assumed", message))
    names = numbered_apart([_name(each, column) for column, each in enumerate(headings)])
    sheet = Sheet(text, found.line.start, text.stop, found.line.number, found.mark, names=tuple(names))
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
    title = found.preamble[0] if found.preamble else ""
    return Contents(tuple(channels), title=title, traps=tuple(traps), zeros=text.zeros)


def _units_beside(found: Found) -> tuple[list[Heading], set[int]]:
    """Give numbers the unit that stands behind each of them in a column of its own; return also these columns."""
    headings, words = list(found.headings), set()
    for column, cells in enumerate(zip(*found.rows, strict=True)):
        known = measure_of(cells[0]) is not None or time_power(cells[0]) is not None
        if column and known and parse_number(cells[0]) is None and len(set(cells)) == 1 and not headings[column].name:
            headings[column - 1] = replace(headings[column - 1], unit=headings[column - 1].unit or cells[0])
            words.add(column)
    return headings, words


def _find(text: Text) -> tuple[Text, Found | None]:
    """Find the table, in the text without what stands before each row."""
    text, headings = without_prefix(text) or (text, ())
    found = find_table(text.head(_HEAD_LINES))
    if found is not None and len(headings) == len(found.headings):
        both = zip(headings, found.headings, strict=True)
        found = replace(found, headings=tuple(Heading(a.name or b.name, a.unit or b.unit) for a, b in both))
    return text, found


def _name(heading: Heading, column: int) -> str:
    return heading.name or f"column {column + 1}"


def _preamble(found: Found) -> tuple[Trap, ...]:
    if not found.preamble:
        return ()
    count = len(found.preamble)
    message = f'{count} line{"s" if count > 1 else ""} of text above the table: "{found.preamble[0][:60]}"'
    return (Trap("preamble", message, count),)


def _formula(found: Found) -> Formula | None:
    """Return the times that an oscilloscope states behind its names: where they start and by what they go on."""
    told = {name.lower(): parse_number(value) for name, value in found.spare}
    start, step = told.get("start"), told.get("increment")
    return None if start is None or not step or not step > 0 else Formula(start, step)


def _without_clock(text: Text, found: Found, column: int) -> tuple[Text, str]:
    """Put seconds from the first in the place of a column of clock times; return also the first."""
    mark = found.mark.encode() or None
    lines: list[bytes] = []
    first, last, days, shown = None, 0.0, 0, ""
    for raw in text.data[found.line.start : text.stop].splitlines(keepends=True):
        body = raw.rstrip(b"\r\n")
        cells = body.split(mark)
        cell = decode(cells[column]).strip().strip('"') if column < len(cells) else ""
        told = clock_s(cell)
        if told is not None:
            _, at, decimals = told
            if first is None:
                first, last, shown = at, at, cell
            days += at < last - _DAY_S / 2
            last = at
            cells[column] = f"{at - first + days * _DAY_S:.{decimals}f}".encode()
            body = (mark or b" ").join(cells)
        lines.append(body + raw[len(raw.rstrip(b"\r\n")) :])
    rows = b"".join(lines)
    start = found.line.start
    return replace(text, data=text.data[:start] + rows + text.data[text.stop :], stop=start + len(rows)), shown


FORMAT = ColumnFormat("table", "any other table: columns of numbers below their names", _evidence, _contents)
