"""PASCO: the text of Capstone, SPARKvue and DataStudio.

What is easy to get wrong:

- Capstone: runs are side by side and end at different rows. Derived columns are empty at the edges. The decimal mark
  may differ between cells: ``-8,90E-4`` next to ``0.12``. The column of times may be missing. SPARKvue writes
  ``Time (s) Run 5``, and columns with dates as text. Localised exports translate time and run, or have headings without
  any unit (``time;position;velocity;acceleration``).
- DataStudio: runs are one below the other, each below ``Voltage, ChA, Run #1`` and ``Time ( s )<TAB>Voltage ( V )``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from acquisition.recordings.tables.format import text_format
from acquisition.recordings.tables.headings import Heading, is_time, name_and_unit, split_heading
from acquisition.recordings.tables.table import Header
from acquisition.recordings.tables.text import Text
from acquisition.recordings.tables.vocabulary import MOTION

_CAPSTONE = re.compile(r"(?P<quantity>.*\S)\s+(?P<run>\S+ #\s?\d+|Run \d+)")
_DATASTUDIO = re.compile(r"(?P<name>[^\t;]+), (?P<run>\S+ #\s?\d+)\s*")
_DATASTUDIO_LINE = re.compile(rb"^[^\t;\n]+, [^\s]+ #[ \t]?\d+[ \t]*$", re.MULTILINE)


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
    is_localised = len(names) > 1 and names[0][:1] not in "#%" and is_time(names[0]) and MOTION.issuperset(names[1:])
    if not is_localised or not re.search(r"\d", "".join(lines[1:2]) or "0"):  # else units follow in a line of their own
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
    for begin in text.matching(_DATASTUDIO_LINE, first.lines):
        if (header := datastudio(text.lines(begin, 2))) is not None:
            yield begin, header


CAPSTONE = text_format(
    "capstone",
    "PASCO Capstone CSV: runs side by side, any decimal mark",
    capstone,
    expected='headings like "Position (m) Run #1"',
)
DATASTUDIO = text_format(
    "datastudio",
    "PASCO DataStudio text: runs one below the other",
    datastudio,
    expected='a line like "Position, ChA, Run #1" and one of headings with units',
    blocks=_datastudio_runs,
)
