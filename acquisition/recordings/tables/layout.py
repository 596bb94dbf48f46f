"""Find the table in the first lines of any text, and the columns that may be its times or row numbers."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from acquisition.block import F8
from acquisition.recordings.recording import FormatIssue
from acquisition.recordings.sampling.timing import Formula
from acquisition.recordings.tables.headings import Heading, heading_of, is_time, is_uncertainty, split_heading
from acquisition.recordings.tables.numbers import THOUSANDS, is_lost, is_quantity, parse_number
from acquisition.recordings.tables.numbers import cell as number_form
from acquisition.recordings.tables.table import Header
from acquisition.recordings.tables.times import in_order, is_newest_first, is_time_cell
from acquisition.recordings.tables.vocabulary import INDEX, NEUTRAL, NUMBERED, SPAN
from acquisition.units import measure_of, time_unit

_MARKS = ("\t", ";", ",", "")
_PROBE, _FEWEST, _SOUND = 20, 3, 0.8
_ABOVE = 6  # number of lines above the rows that are searched for names
_COMMENT = "#%*!'/ \ufeff"
_NUMBERS = re.compile(r"[-+\d.,;eE\s\[\]]*\d[-+\d.,;eE\s\[\]]*")
_DATE = re.compile(r"\d{1,4}([-./])\d{1,2}\1\d{1,4}", re.ASCII)
_SETTING = re.compile(r"[=]|:(?!\s*$)")
_LONGEST_NAME = 5  # maximum number of words
_BRACKETED = re.compile(r"\([^()]*\)|\[[^\[\]]*\]")
_TOKEN = re.compile(r"[^\s(\[]+(?:\s*[(\[][^)\]]*[)\]])?")
_SEP = re.compile(r"[\ufeff\"]*sep=(.)")  # a line of Excel
_FIRST_NUMBERS = 10  # row numbers begin below this; the first may be missing, in rows unlike the others
_NONE = ("", "lost")
"""Kinds of cells that may stand in any column."""
_RESTARTS = 0.1  # maximum share of steps back in a column that is named as times
_SPARSE = 0.2  # minimum share of rows with a number in a column of samples
_CAPITAL = re.compile(r"(?<![^\W\d_])T(?![^\W\d_])")


@lru_cache(maxsize=1)  # the same table is needed twice: to recognise a file, and to read it
def find_table(lines: tuple[str, ...]) -> Header | None:
    """Find the first rows of numbers in a text, and the names of their columns; None if there are none.

    Rows are lines in which each column contains either only numbers or only words, apart from empty cells. The chosen
    separator gives the earliest rows; among several such separators, it is one that also fits a line of names.
    """
    candidates = []
    separator_line = _SEP.match(lines[0]) if lines else None
    for order, mark in enumerate(separator_line[1] if separator_line else _MARKS):
        # Without its mark each line is a single cell, a case that the first separator has covered.
        if (not order or not mark or any(mark in each for each in lines)) and (table := _split_by(lines, mark)):
            candidates.append(((_is_torn(table), table.lines, not table.named, not _is_separator(table), order), table))
    return min(candidates)[1] if candidates else None


def _is_torn(table: Header) -> bool:
    """Return whether a cell has another separator inside, or a time and a number: its comma is a decimal comma."""
    return any(
        any(mark in cell for mark in "\t;") or (" " in cell and _holds_time_and_number(cell))
        for cell in table.rows[0]
        if parse_number(cell) is None
    )


def _holds_time_and_number(cell: str) -> bool:
    time, _, number = cell.rpartition(" ")
    return not is_time_cell(cell) and is_time_cell(time) and parse_number(number) is not None


def _is_separator(table: Header) -> bool:
    """Return whether commas between integers are separators: there are as many names, or the first column counts."""
    names = [each.name for each in table.headings]
    if table.delimiter != "," or len(names) < 2:
        return False
    if table.named:
        return all(names) and len(_with_units(names)) == len(names)
    first = columns_of(table.rows)[0]
    return runs_forward(first) and _is_even(first) and bool((first == np.rint(first)).all())


def _split_by(lines: Sequence[str], mark: str) -> Header | None:
    """Find the first rows of numbers in lines with a separator; None if there are none."""
    filled = [at for at, each in enumerate(lines) if each.strip(mark + " " if mark else "\t ")]
    cells = [_cells(lines[at], mark) for at in filled]
    kinds = [["number" if THOUSANDS.fullmatch(cell.encode()) else _kind(cell) for cell in row] for row in cells]
    for at, first in enumerate(kinds):
        if not _is_row(first) or cells[at][0] == "-" or any("=" in cell for cell in cells[at]):
            continue  # "- 0.5" is a list of YAML
        probe = kinds[at : at + _PROBE]
        width = max((len(row) for row in probe if _is_row(row)), default=0) if mark else len(first)
        like = [_alike(row, first, width, mark) for row in probe]
        if sum(like[:_FEWEST]) == _FEWEST and sum(like) >= _SOUND * len(like):
            below = [*zip(*(row for row in cells[at:] if len(row) == width), strict=True)]
            if any(all(cell.startswith("(") for cell in column) for column in below):
                continue  # numbers that are all in brackets are not negative
            while at and _belongs(kinds[at - 1], cells[at - 1], below):
                at -= 1
            rows = [
                cells_of_row
                for cells_of_row, row in zip(cells[at:], kinds[at:], strict=True)
                if _alike(row, first, width, mark)
            ]
            padded = tuple(tuple(row + [""] * (width - len(row))) for row in rows)
            return replace(_with_names(lines, filled[at], mark, width), rows=padded)
    return None


def _cells(line: str, mark: str) -> list[str]:
    """Split a row into cells; separators at its end are ignored."""
    if mark and '"' in line:
        return split_heading(line, mark)[0]
    if mark:
        cells = [cell.strip(" ") for cell in line.rstrip(mark + " ").split(mark)]
    else:
        cells = [cell for cell in line.replace("\t", " ").split(" ") if cell]
    return [cell[1:-1].strip() if len(cell) > 1 and cell[0] == cell[-1] == '"' else cell for cell in cells]


def _kind(cell: str) -> str:
    if not cell:
        return ""
    if parse_number(cell) is not None:
        return "number"
    if is_lost(cell):
        return "lost"
    if is_quantity(cell):
        return "mixed"  # 26.9 cm, as sketches print it
    if is_time_cell(cell):
        return "clock"
    if _DATE.fullmatch(cell):
        return "text"
    return "mixed" if _NUMBERS.fullmatch(cell) else "text"


def _is_row(kinds: Sequence[str]) -> bool:
    values = kinds.count("number") + kinds.count("clock")
    words = kinds.count("text") + kinds.count("lost")
    return "number" in kinds and values >= words and "mixed" not in kinds


def _alike(kinds: Sequence[str], first: Sequence[str], width: int, mark: str) -> bool:
    """Return whether a line is a row like the first: text below text, numbers below numbers, or empty cells."""
    if not _is_row(kinds) or (not mark and len(kinds) != width) or len(kinds) > width:
        return False
    return all(a == b or a in _NONE or b in _NONE for a, b in zip(kinds, first, strict=False))


def _belongs(kinds: Sequence[str], cells: Sequence[str], below: Sequence[tuple[str, ...]]) -> bool:
    """Return whether a line above rows of numbers is one of them: each cell is a number or a word among numbers.

    ``below`` are the cells of the rows in each column.
    """
    return (
        len(cells) == len(below)
        and "number" in kinds
        and all(
            kind in ("number", "clock", "lost")
            or (kind == "text" and cell in column and any(parse_number(each) is not None for each in column))
            for kind, cell, column in zip(kinds, cells, below, strict=True)
        )
    )


def _with_names(lines: Sequence[str], start: int, mark: str, width: int) -> Header:
    """Return the header of a table whose first row is known; its title is the first line of text above the table."""
    above = [at for at in range(start - 1, -1, -1) if lines[at].strip(_COMMENT)][:_ABOVE]
    names, units, at_names = [""] * width, [""] * width, start
    spare: tuple[tuple[str, str], ...] = ()
    for at in above:
        cells = _names(lines[at], mark, width, numbered=at_names < start)
        if not cells:
            continue
        below = cells[:width] + [""] * (width - len(cells))
        if at_names == start and _are_units(cells):
            units, at_names, spare = below, at, tuple(("", each) for each in cells[width:])
            continue
        names, at_names = below, at
        behind = [each for _, each in spare] + [""] * len(cells)
        spare = tuple(zip(cells[width:], behind, strict=False))
        break
    if at_names < start and not any(names) and not any(each.startswith(("(", "[")) for each in units):
        names, units = units, names  # a single line of words contains names, even if some of the words are also units
    headings = []
    for name, unit in zip(names, units, strict=True):
        plain, of_heading = heading_of(name)
        headings.append(Heading(plain, of_heading or unit.strip(" ()[]")))
    preamble = [text for each in lines[:at_names] if (text := each.strip(_COMMENT + "\t;,"))]
    shown = ", ".join(f'"{each.name}"' for each in headings if each.name)
    why = f"numbers begin in line {start + 1}, below {shown or 'no names'}"
    title, traps = preamble[0] if preamble else "", _skipped(preamble)
    return Header(why, start, mark, headings, formula=_formula(spare), title=title, traps=traps)


def _skipped(preamble: Sequence[str]) -> tuple[FormatIssue, ...]:
    if not preamble:
        return ()
    count = len(preamble)
    lines = "1 line of text above the table was" if count == 1 else f"{count} lines of text above the table were"
    return (FormatIssue("preamble", f'{lines} skipped; the first is "{preamble[0][:40]}"', count),)


def _formula(spare: Sequence[tuple[str, str]]) -> Formula | None:
    """Return the times that an oscilloscope states by a start and an increment after the names; else None.

    ``spare`` are the names beyond the last column, each with the cell below it in the line of units.
    """
    settings = {name.lower(): parse_number(value) for name, value in spare}
    start, step = settings.get("start"), settings.get("increment")
    return None if start is None or not step or not step > 0 else Formula(start, step)


def _names(line: str, mark: str, width: int, *, numbered: bool = False) -> list[str]:
    """Split a line into one name for each column; return an empty list if that is impossible.

    At least half of the names must be words, or one name if channels may be ``numbered``. For a single column, a
    setting or a sentence is not a name.
    """
    plain = line.lstrip(_COMMENT).rstrip().removeprefix("DEF=")
    if width == 1 and (_SETTING.search(plain) or len(plain.split()) > _LONGEST_NAME):
        return []
    for cells in _splits(plain, mark, width):
        words = [cell for cell in cells if cell and parse_number(cell) is None and not is_time_cell(cell)]
        if words and (numbered or 2 * len(words) >= len([cell for cell in cells if cell])):
            return cells
    return []


def _splits(line: str, mark: str, width: int) -> Iterator[list[str]]:
    """Yield the possible splits of a line into cells, with the most likely split first."""
    by_mark = split_heading(line) if any(each in line for each in "\t;,") else ([line], "")
    by_this_mark = [cell.strip().strip('"') for cell in line.split(mark)] if mark and '"' not in line else by_mark[0]
    if mark and mark in line:
        if len(merged := _with_units(by_this_mark)) == width < len(by_this_mark):
            yield merged
        while len(by_this_mark) > width and not by_this_mark[-1]:
            by_this_mark.pop()
        if len(by_this_mark) >= width or 2 * len(by_this_mark) > width > 2:
            yield by_this_mark
        return
    if len(by_mark[0]) == width and (width > 1 or by_mark[1] == ""):
        yield by_mark[0]
    apart = [re.split(r"\s{2,}|\t", line), [each.group() for each in _TOKEN.finditer(line)], line.split()]
    yield from (each for each in apart if len(each) == width)
    # More names than columns are accepted only if the names are short.
    tokens = line.split()
    if not mark and width < len(tokens) <= 3 * width and all(len(each) < 6 for each in tokens):
        yield tokens


def _with_units(names: Sequence[str]) -> list[str]:
    """Return names to which the units behind them were joined: a comma may separate both, as in ``Time, s``."""
    joined: list[str] = []
    for name in names:
        if joined and _is_unit_of(name, joined[-1]):
            joined[-1] += f" ({name})"
        else:
            joined.append(name)
    return joined


def _is_unit_of(unit: str, name: str) -> bool:
    """Return whether a word is the unit of the name before it: a unit of time of a time, another one of the rest."""
    if unit in ("1", "d", "h") or heading_of(name)[1]:
        return False
    return time_unit(unit) is not None if is_time(name) else measure_of(unit) is not None and len(name) > 1


def wrong_commas(table: Header) -> bool:
    """Return whether the times alone have decimal commas in rows that commas separate: more cells than names."""
    names, width = sum(1 for each in table.headings if each.name), len(table.headings)
    if table.delimiter != "," or names < 2 or width not in (names + 1, 2 * names) or not table.headings[names - 1].name:
        return False
    times = columns_of([[f"{row[0]}.{row[1]}" if row[-1] else row[0]] for row in table.rows])[0]
    return runs_forward(times) and _is_even(times)


def _are_units(cells: Sequence[str]) -> bool:
    """Return whether a line contains units: at least half of its words are units or bracketed, and none means time."""
    filled = [cell for cell in cells if cell]
    measures = [
        measure_of(plain) is not None or time_unit(plain) is not None or bool(_BRACKETED.fullmatch(cell))
        for cell in filled
        if parse_number(cell) is None
        for plain in (cell.strip(" ()[]"),)
    ]
    return (
        bool(measures)
        and sum(measures) * 2 >= len(measures)
        and not any(is_time(cell) and not re.fullmatch(r"[(\[]?[mnuµμ]?s(ec)?[)\]]?", cell) for cell in filled)
    )


def columns_of(rows: Sequence[Sequence[str]]) -> list[F8]:
    """Return the numbers of each column; NaN for cells that are not numbers."""
    read = [[parse_number(cell) for cell in row] for row in rows]
    return [np.array([np.nan if x is None else x for x in column]) for column in zip(*read, strict=True)]


def are_row_numbers(column: F8) -> bool:
    """Return whether a column starts at a small number and increases by one in every row."""
    return bool(column.size > 1 and column[0] in range(_FIRST_NUMBERS) and (np.diff(column) == 1.0).all())


def runs_forward(column: F8) -> bool:
    """Return whether a column rises in all but a few rows."""
    finite = column[np.isfinite(column)]
    steps = np.diff(finite)
    return bool(
        finite.size >= 3 and finite[-1] > finite[0] and np.mean(steps >= 0) >= 0.95 and np.mean(steps > 0) >= 0.5
    )


def _is_even(column: F8) -> bool:
    steps = np.diff(column[np.isfinite(column)])
    usual = float(np.median(steps))
    return bool(usual > 0 and np.mean(np.abs(steps - usual) <= 0.5 * usual) >= 0.8)


def is_aside(heading: Heading, column: F8, others: bool) -> bool:
    """Return whether a column is row numbers (if ``others`` may be the times), an uncertainty, or nearly empty."""
    name = " ".join(heading.name.lower().replace("_", " ").split())
    index = others and are_row_numbers(column) and (name in INDEX or bool(NUMBERED.fullmatch(name)))
    return index or is_uncertainty(name) or bool(np.mean(np.isfinite(column)) < _SPARSE)


def are_named_times(heading: Heading) -> bool:
    """Return whether a heading names times; a capital T does not, because it often denotes a period."""
    fits = not heading.unit or time_unit(heading.unit) is not None
    return is_time(heading.name) and not _CAPITAL.search(heading.name) and fits


def times_by_name(table: Header, columns: Sequence[F8]) -> list[int]:
    """Return the rising columns that are named as times, and the first column if its even steps have a unit of time.

    A column that is named counts as rising if its times can be put in order, or start again. No period is zero, so T
    from zero on in even steps is a time.
    """
    named = [
        column
        for column, each in enumerate(table.headings)
        if are_named_times(each)
        or (
            column == 0
            and time_unit(each.unit) is not None
            and (not SPAN.search(each.name) or (each.name == "T" and columns[0][0] == 0.0))
            and _is_even(columns[0])
        )
    ]
    return [column for column in named if _may_be_times(columns[column], [row[column] for row in table.rows])]


def _may_be_times(column: F8, cells: Sequence[str]) -> bool:
    if runs_forward(column) or is_newest_first(column):
        return True
    forms = np.array([number_form(cell)[1] for cell in cells[: column.size]], np.int8) if cells else None
    steps = np.diff(column[np.isfinite(column)])
    again = steps.size and np.mean(steps < 0) <= _RESTARTS and np.mean(steps > 0) >= 0.5
    return bool(again) or runs_forward(in_order(column, forms)[0])


def times_by_steps(headings: Sequence[Heading], columns: Sequence[F8]) -> int | None:
    """Return the column that must be the times because of its steps; None if there is no such column.

    This is the first column if it rises in even steps, else the only column that does so, else the only column that
    rises. Row numbers are not considered, because their step is unknown. Neither are columns whose name or unit
    denotes something else.
    """
    fit = [
        column
        for column, each in enumerate(headings)
        if NEUTRAL.fullmatch(each.name) and (not each.unit or time_unit(each.unit) is not None)
        if runs_forward(columns[column]) and not are_row_numbers(columns[column])
    ]
    even = [column for column in fit if _is_even(columns[column])]
    if even and even[0] == 0:
        return 0
    for choice in (even, fit):
        if len(choice) == 1:
            return choice[0]
    return None
