"""What sketches print for people, copied from a serial monitor: ``Distance: 26.9 cm``, ``Time:0<TAB>Dist:26.87``.

The numbers of a line are channels by the words before them and the units behind them, as in
:mod:`acquisition.line_numbers`. A line without them (``Retrying!``) is a row that could not be read. Of one distance in
two units, the finer one is read. A time of day at the start of each line is the time.
"""

from __future__ import annotations

import re
from collections import Counter

import numpy as np

from acquisition.errors import FormatError
from acquisition.line_numbers import UNIT_OF_WORD, Number, find_distance, has_decimal_comma, numbers
from acquisition.recordings.families.markup import BLANKS
from acquisition.recordings.tables.format import ColumnFormat
from acquisition.recordings.tables.headings import Heading, is_time
from acquisition.recordings.tables.layout import runs_forward
from acquisition.recordings.tables.numbers import UNREAD_CELL
from acquisition.recordings.tables.table import Column, Lines, Table, side_by_side
from acquisition.recordings.tables.text import Text, is_text, joined_in_turn, text_of
from acquisition.recordings.tables.times import CLOCK, clock_times

_FEWEST, _SHARE, _MOST, _HEAD = 3, 0.6, 40, 120
_BRACKETS = re.compile(r"\s*[(\[]")  # as Python prints tuples and lists
_CLOCK = re.compile(rf"\s*\[?(?:{CLOCK.pattern})(?=[\]\s,;|-])", re.ASCII)
LineForm = tuple[tuple[tuple[str, ...], str], ...]
"""The words and units of the numbers of a line."""


def _usual(of: list[tuple[int, str]]) -> tuple[bool, LineForm] | None:
    """Return whether commas are decimal commas, and the usual kind of line; None without words or units."""
    lines = [line for _, line in of[: _MOST + 1][:-1]]  # the last may be cut
    pairs = [match for line in lines if (match := re.search(r"(\d+),\d", line))]
    marks = Counter(has_decimal_comma(match.string) for match in pairs).most_common(1)
    # Nothing but a comma between two groups of digits: a clock before it counts.
    counts = runs_forward(np.array([float(match[1]) for match in pairs]))
    comma = bool(marks and (marks[0][0] or (marks[0][0] is None and not counts)))
    kinds = Counter(kind for line in lines if (kind := _kind(numbers(line, decimal_comma=comma))))
    ((kind, count),) = kinds.most_common(1) or [((), 0)]
    worded = any(words or unit for words, unit in kind) or all(_BRACKETS.match(line) for line in lines[-_FEWEST:])
    return (comma, kind) if worded and count >= max(_FEWEST, _SHARE * len(lines)) else None


def _joined(lines: list[str]) -> list[tuple[int, str]]:
    """Return lines with their numbers, but for blank ones; two kinds in turn (time, then distance) are joined."""
    joined = joined_in_turn(lines, lambda line: _kind(numbers(line)), "\t")
    return [(number, line) for number, line in enumerate(joined, 1) if line.strip()]


def _kind(of_line: list[Number]) -> LineForm:
    return tuple((each.label, each.unit) for each in of_line)


def _evidence(head: bytes) -> str:
    markup = head.lstrip(BLANKS).startswith(b"<")
    lines = _joined(Text.of(head).head(_HEAD)) if is_text(head) and not markup else []
    return "the lines are words with numbers, as a sketch prints them" if _usual(lines) else ""


def _tables(path: str, data: bytes) -> list[Table]:
    text = text_of(path, data)
    joined = _joined(text.lines())
    usual = _usual(joined)
    if usual is None:
        raise FormatError(path, "expected lines with words and numbers", "export a table of times and positions")
    comma, kind = usual
    lines = [(number, line, numbers(line, decimal_comma=comma)) for number, line in joined]
    like = [_kind(of_line) == kind for _, _, of_line in lines]
    first, stop = like.index(True), len(like) - like[::-1].index(True)
    rows = [(line, of_line if _kind(of_line) == kind else []) for _, line, of_line in lines[first:stop]]
    distance = find_distance(*rows[0])
    headings, columns = [], []
    for at, (words, unit) in enumerate(kind):
        printed = re.findall(r"[^\W\d_]+", rows[0][1][at].before)
        name = " ".join(printed[:-1] if len(words) > 1 and words[-1] in UNIT_OF_WORD else printed)
        is_other = distance is not None and rows[0][1][at].start != distance.start
        headings.append(
            Heading(
                name, "" if unit == "other" else unit, role="time" if is_time(name) else "aside" if is_other else ""
            )
        )
        values = np.array([of_line[at].value if of_line else np.nan for _, of_line in rows])
        forms = [max(0, round(-np.log10(of_line[at].step))) if of_line else UNREAD_CELL for _, of_line in rows]
        columns.append(Column("", "", values, np.array(forms, np.int8)))
    stamps = [match[0].strip(" [").encode() if (match := _CLOCK.match(line)) else b"" for line, _ in rows]
    if all(stamp or not of_line for stamp, (_, of_line) in zip(stamps, rows, strict=True)):
        columns.insert(0, Column("", "", *clock_times(stamps)))
        headings.insert(0, Heading("Time", "s", role="time"))
    numbered = np.array([number for number, _, _ in lines[first:stop]])
    where = Lines(numbered, np.zeros(len(rows), bool), zeros=text.zeros)
    return side_by_side(Table(tuple(columns), lines=where), headings)


FORMAT = ColumnFormat("sketch", "lines of words and numbers that a microcontroller's sketch prints", _evidence, _tables)
