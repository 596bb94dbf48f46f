"""Families of text that are known by the lines above their rows: PASCO and Vernier.

What is easy to get wrong:

- Capstone: runs are side by side and end at different rows. Derived columns are empty at the edges. The decimal mark
  may differ between cells: ``-8,90E-4`` next to ``0.12``. The column of times may be missing. SPARKvue writes
  ``Time (s) Run 5``, and columns with dates as text. Localised exports translate time and run, or have headings without
  any unit (``time;position;velocity;acceleration``).
- DataStudio: runs are one below the other, each below ``Voltage, ChA, Run #1`` and ``Time ( s )<TAB>Voltage ( V )``.
- Vernier Format 2: line 2 is a title, line 3 the name of the data set. Then come long names, short names and units, or,
  from small programs, only long names and units, or headings with units in brackets. Further data sets follow, each
  with its name and headings.
- Logger Pro: runs are side by side under ``Latest: Position (m)`` or ``Data Set 1:Time(s)``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from acquisition.recordings.tables.cells import parse_number
from acquisition.recordings.tables.format import text_format
from acquisition.recordings.tables.headings import Heading, headings_of, is_time, name_and_unit, split_heading, words
from acquisition.recordings.tables.table import Header
from acquisition.recordings.tables.text import Text

_CAPSTONE = re.compile(r"(?P<quantity>.*\S)\s+(?P<run>\S+ #\s?\d+|Run \d+)")
_QUANTITIES = words(
    "position velocity acceleration posizione velocità velocita accelerazione ort weg geschwindigkeit beschleunigung "
    "vitesse accélération posición velocidad aceleración 位置 速度 加速度"
)
_DATASTUDIO = re.compile(r"(?P<name>[^\t;]+), (?P<run>\S+ #\s?\d+)\s*")
_DATASTUDIO_LINE = re.compile(rb"\n([^\t;\n]+, [^\s]+ #[ \t]?\d+[ \t]*)(?=\n)")
_LOGGER_PRO = re.compile(r"(?P<run>[^:]+):\s*(?P<quantity>.+)")
_VERNIER = "Vernier Format 2"
_MOST_HEADINGS, _MOST_LINES = 3, 40


def capstone(lines: Sequence[str]) -> Header | None:
    """Read headings that end in a run, or the headings of a localised export."""
    cells, mark = split_heading(lines[0])
    matches = [_CAPSTONE.fullmatch(cell) for cell in cells]
    if any(matches) and all(each or not cell for each, cell in zip(matches, cells, strict=True)):
        headings = [Heading(*name_and_unit(each["quantity"]), each["run"]) if each else Heading("") for each in matches]
        run = next(each.run for each in headings if each.run)
        return Header(f'headings in line 1 end in a run, "{run}"', 1, mark, headings)
    names = [cell.lower() for cell in cells]
    # A comment mark shows that the line comes from another program.
    known = len(names) > 1 and names[0][:1] not in "#%" and is_time(names[0]) and _QUANTITIES.issuperset(names[1:])
    if not known:
        return None
    return Header(f'line 1 is the headings "{mark.join(cells)}"', 1, mark, [Heading(cell) for cell in cells])


def datastudio(lines: Sequence[str]) -> Header | None:
    """Read the name of a run and, below it, headings that all have units."""
    title = _DATASTUDIO.fullmatch(lines[0])
    if title is None or len(lines) < 2:
        return None
    cells, mark = split_heading(lines[1])
    headings = [Heading(*name_and_unit(cell), title["run"]) for cell in cells]
    if len(headings) < 2 or not all(each.unit for each in headings):
        return None
    name = lines[0].strip()
    return Header(f'line 1 is the run, "{name}", line 2 the headings with units', 2, mark, headings, title=name)


def _datastudio_runs(text: Text, first: Header) -> Iterator[tuple[int, Header]]:
    """Yield the two lines above each further run."""
    del first
    for match in _DATASTUDIO_LINE.finditer(text.data):
        begin = text.at(match.start(1))
        if (header := datastudio(text.lines(begin, 2))) is not None:
            yield begin, header


def logger_pro(lines: Sequence[str]) -> Header | None:
    """Read headings that begin with a run."""
    cells, mark = split_heading(lines[0])
    matches = [match for cell in cells if (match := _LOGGER_PRO.fullmatch(cell))]
    if len(matches) < 2 or len(matches) != len(cells):
        return None
    headings = [Heading(*name_and_unit(each["quantity"]), each["run"].strip()) for each in matches]
    if not any(is_time(each.name) for each in headings) and not all(each.unit for each in headings):
        return None
    return Header(f'headings in line 1 begin with a run, "{headings[0].run}: "', 1, mark, headings)


def vernier(lines: Sequence[str]) -> Header | None:
    """Read the title and the headings of the first data set."""
    if not lines[0].lstrip().startswith(_VERNIER):
        return None
    title = lines[1].strip() if len(lines) > 1 else ""
    below = _data_set(lines[2:])
    why = f'line 1 is "{_VERNIER}"'
    if below is None:
        return Header(why, len(lines), "\t", [], title=title)
    run, count, headings = below
    return Header(why, 2 + count, "\t", headings, run=run, title=title)


def _data_set(lines: Sequence[str]) -> tuple[str, int, list[Heading]] | None:
    """Return the name of a data set, the number of lines above its rows, and its headings; None if no rows follow."""
    above: list[str] = []
    for at, line in enumerate(lines):
        if not line.strip(" ").strip():
            continue
        cells = [cell.strip() for cell in line.strip().split("\t")]
        numbers = [parse_number(cell) is not None for cell in cells]
        if above and any(numbers) and all(number or not cell for number, cell in zip(numbers, cells, strict=True)):
            run = above[0].strip() if "\t" not in above[0].strip() else ""
            names = above[1 if run else 0 :]
            return (run, at, _vernier_headings(names)) if 1 <= len(names) <= _MOST_HEADINGS else None
        above.append(line)
        if len(above) == _MOST_LINES:
            return None
    return None


def _vernier_headings(lines: Sequence[str]) -> list[Heading]:
    """Combine long names with units; the units are in the last of two or three lines."""
    names = [cell.strip() for cell in lines[0].rstrip().split("\t")]
    if len(lines) == 1:
        return headings_of(names)
    units = [cell.strip().strip("()") for cell in lines[-1].split("\t")]
    units += [""] * (len(names) - len(units))
    return [Heading(name, unit) for name, unit in zip(names, units, strict=False)]


def _vernier_sets(text: Text, first: Header) -> Iterator[tuple[int, Header]]:
    """Yield further data sets: each repeats the line of long names, below its own name or below all lines of a file."""
    names = [at for at in range(2, min(first.lines, len(text))) if text.line(at).strip()]
    if not names:
        return
    long_names = names[1 if first.run and len(names) > 1 else 0]
    needle = b"\n" + text.data[text.starts[long_names] : text.starts[long_names + 1]].rstrip(b"\n")
    rows = first.lines
    while (again := text.find(needle, rows)) is not None:
        begin = text.words_above(rows, again + 1)
        head = text.head(_MOST_LINES, begin)
        skip = next((at + 2 for at, line in enumerate(head[:_MOST_HEADINGS]) if line.startswith(_VERNIER)), 0)
        below = _data_set(head[skip:])
        if begin <= rows or below is None:
            return
        yield begin, Header(first.why, skip + below[1], "\t", below[2], run=below[0])
        rows = again + 1


_TITLE = "PASCO Capstone CSV: runs side by side, any decimal mark"
CAPSTONE = text_format("capstone", _TITLE, capstone, expected='headings like "Position (m) Run #1"')
DATASTUDIO = text_format(
    "datastudio",
    "PASCO DataStudio text: runs one below the other",
    datastudio,
    expected='a line like "Position, ChA, Run #1" and one of headings with units',
    blocks=_datastudio_runs,
)
VERNIER = text_format(
    "vernier", "Vernier Format 2 text of Logger Pro", vernier, expected=f'"{_VERNIER}" in line 1', blocks=_vernier_sets
)
