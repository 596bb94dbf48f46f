"""Any table: rows of numbers below whatever names them, of programs that have no family of their own.

The last to be asked. :func:`acquisition.recordings.tables.finding.find_table` says where the table is; here is said
which of its columns are times. What a careless reader would get wrong:

- A column is a time by its name, in a dozen languages, and only if it runs forward; or, where names say nothing
  against it, because it alone runs forward. Row numbers are no times, and a period is none.
- Thousands may be set apart; a comma that may be of thousands or of decimals is asked about.
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
from acquisition.recordings.tables.grouped import ungrouped
from acquisition.recordings.tables.roles import columns_of, is_aside, times_by_name, times_by_steps
from acquisition.recordings.tables.sheet import ColumnFormat
from acquisition.recordings.tables.text import Line, Text, decode, guess_delimiter, is_text, parse_number, text_of
from acquisition.recordings.tables.wrapped import SETTINGS, begins_with_lists, unwrapped
from acquisition.recordings.units import measure_of, time_power

__all__ = ["FORMAT"]

_HEAD_LINES = 300
_DAY_S = 86400.0
_MONITOR = b" -> "
_WRAPS = (b"[", SETTINGS.encode())  # how rows begin that are wrapped, and could be taken for a table as they stand
_BLANKS = bytes.maketrans(b"[];", b"   ")


def _evidence(head: bytes) -> str:
    if not is_text(head) or head.lstrip(b"\xef\xbb\xbf \r\n\t").startswith(b"<"):
        return ""
    if named("", head) is not None:
        return ""  # the one who refuses the file says what it is
    try:
        _, found = _find(*_plain("", Text.of(head)))
    except FormatError as error:
        return str(error)  # said again, with the file's name, when it is read
    if found is None:
        return "it holds lists of numbers with names" if begins_with_lists(decode(head)) else ""
    names = ", ".join(f'"{each.name}"' for each in found.headings if each.name)
    return f"numbers begin in line {found.line.number}, below {names or 'no names'}"


def _contents(path: str, data: bytes) -> Contents:
    text, found = _find(*_plain(path, text_of(path, data)))
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


def _plain(path: str, text: Text) -> tuple[Text, list[Line]]:
    """Take marks of thousands out of a text, whose head's last line says what separates cells; return also its head."""
    lines = text.head(_HEAD_LINES)
    rows = text.data[text.start : text.stop]
    take = ungrouped(path, rows, guess_delimiter(lines[-1].text)) if lines else None
    if take is None or begins_with_lists(decode(rows[: 1 << 16])):  # a list's commas separate
        return text, lines
    rows = take(rows)
    text = replace(text, data=text.data[: text.start] + rows + text.data[text.stop :], stop=text.start + len(rows))
    return text, text.head(_HEAD_LINES)


def _find(text: Text, lines: list[Line]) -> tuple[Text, Found | None]:
    """Find the table; where rows are wrapped in words or brackets, in the text without these."""
    wrapped = any(each in text.data[: 1 << 16] for each in (_MONITOR, b" & ")) or text.data.startswith(
        _WRAPS, text.start
    )
    found = None if wrapped else find_table(lines)
    told = None if found is not None else unwrapped(text)
    if told is None:
        return text, found or find_table(lines)
    plain, headings = told
    found = find_table(plain.head(_HEAD_LINES))
    if found is not None and len(headings) == len(found.headings):
        both = zip(headings, found.headings, strict=True)
        found = replace(found, headings=tuple(Heading(a.name or b.name, a.unit or b.unit) for a, b in both))
    return plain, found


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
