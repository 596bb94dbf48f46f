"""Text of LabChart (ADInstruments) and AcqKnowledge (Biopac).

- LabChart: ``Interval=``, ``ChannelTitle=`` and ``UnitName=`` above rows that begin with their time. Each block has its
  own lines and is a run. ``#*`` begins a comment behind a row.
- AcqKnowledge: ``10 msec/sample``, ``2 channels``, name and unit of each, then ``CH1 CH2`` and the numbers of samples.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import takewhile

from acquisition.recordings.sampling.timing import Formula
from acquisition.recordings.tables.format import text_format
from acquisition.recordings.tables.headings import Heading
from acquisition.recordings.tables.numbers import parse_number
from acquisition.recordings.tables.table import Header
from acquisition.recordings.tables.text import Text
from acquisition.recordings.tables.times import clock_s, duration_s

_INTERVAL = re.compile(rb"^Interval=", re.MULTILINE)
_SAMPLING = re.compile(r"([\d.,]+ \w+)/sample\s*", re.IGNORECASE)
_CHANNELS = re.compile(r"(\d{1,3}) channels\s*", re.IGNORECASE)


def labchart(lines: Sequence[str]) -> Header | None:
    """Read the lines above a block."""
    if not lines[0].startswith("Interval="):
        return None
    above = [line.split("\t") for line in takewhile(lambda line: "=" in line, lines)]
    settings = {cells[0].rstrip("= "): [cell.strip() for cell in cells[1:]] for cells in above}
    titles, units = settings.get("ChannelTitle", []), settings.get("UnitName", [])
    step = duration_s(" ".join(settings.get("Interval", [])))
    if not titles or step is None or len(above) >= len(lines):
        return None
    channels = [Heading(title, unit) for title, unit in zip(titles, [*units, *[""] * len(titles)], strict=False)]
    first = lines[len(above)].split("\t")
    timed = len([cell for cell in first if cell and not cell.startswith("#")]) > len(channels)
    headings = [Heading("Time", "s", role="time"), *channels] if timed else channels
    clocks = (0,) if timed and clock_s(first[0]) else ()
    formula = None if timed or not step[0] > 0 else Formula(0.0, step[0])
    why = 'it begins with "Interval=", as LabChart writes it'
    return Header(why, len(above), "\t", headings, formula=formula, run="Block 1", clocks=clocks)


def _blocks(text: Text, first: Header) -> Iterator[tuple[int, Header]]:
    for number, begin in enumerate(text.matching(_INTERVAL, first.lines), 2):
        if (header := labchart(text.lines(begin, 40))) is not None:
            yield begin, replace(header, run=f"Block {number}")


def acqknowledge(lines: Sequence[str]) -> Header | None:
    """Read the sampling interval, and name and unit of each channel."""
    sampling = next((at for at, line in enumerate(lines[:3]) if _SAMPLING.fullmatch(line)), None)
    count = _CHANNELS.fullmatch(lines[sampling + 1]) if sampling is not None and len(lines) > sampling + 1 else None
    if sampling is None or count is None:
        return None
    step = duration_s(lines[sampling].partition("/")[0].replace("msec", "ms"))
    at = sampling + 2 + 2 * int(count[1])
    names = [line.strip() for line in lines[sampling + 2 : at]]
    if step is None or not step[0] > 0 or len(lines) < at + 3:
        return None
    mark = next((mark for mark in "\t;," if mark in lines[at]), "\t")
    columns = [cell.strip() for cell in lines[at].split(mark) if cell.strip()]
    sizes = [cell for cell in lines[at + 1].split(mark) if cell.strip()]
    counted = bool(sizes) and all(cell.strip().isdecimal() for cell in sizes) and len(set(sizes)) == 1
    channels = [Heading(name, unit) for name, unit in zip(names[::2], names[1::2], strict=True)]
    if len(columns) > len(channels):
        channels.insert(0, Heading("Time", columns[0], role="time"))
    samples = int(sizes[0]) if counted and parse_number(sizes[0]) else None
    formula = Formula(0.0, step[0], samples) if len(columns) <= int(count[1]) else None
    why = f'line {sampling + 1} is "{lines[sampling].strip()}", as AcqKnowledge writes it'
    return Header(why, at + 1 + counted, mark, channels, formula=formula, title=lines[0].strip() if sampling else "")


LABCHART = text_format("labchart", "LabChart text: each block a run", labchart, blocks=_blocks)
ACQKNOWLEDGE = text_format("acqknowledge", "AcqKnowledge text", acqknowledge)
