"""Find the table in a text: preamble, names, units, first row and separator. No numbers are read here."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

from acquisition.recordings.tables.contents import Heading, is_time, name_and_unit, split_heading
from acquisition.recordings.tables.text import Line, parse_number, split_cells
from acquisition.recordings.units import measure_of, time_power

__all__ = ["TableLayout", "clock_s", "find_table", "heading_of"]

_MARKS = ("\t", ";", ",", "")
_PROBE, _FEWEST, _SOUND = 20, 3, 0.8
_ABOVE = 6  # number of lines above the rows that are searched for names
_COMMENT = "#%*!'/ \ufeff"
_BRACKETS = re.compile(r"[\[\];]")  # brackets and semicolons of a matrix as MATLAB writes it
_NUMBERS = re.compile(r"[-+\d.,;eE\s\[\]]*\d[-+\d.,;eE\s\[\]]*")
_DATE = re.compile(r"\d{1,4}([-./])\d{1,2}\1\d{1,4}", re.ASCII)
_CLOCK = re.compile(
    r"(?P<date>\d{1,4}[-./]\d{1,2}[-./]\d{1,4}[T ,]*)?"
    r"(?:(?P<h>\d{1,2}):(?P<m>\d\d)(?::(?P<s>\d\d(?:[.,]\d{1,9})?))?|(?P<m2>\d{1,2}):(?P<s2>\d\d[.,]\d{1,9}))"
    r"\s*(?P<half>[aApP]\.?[mM]\.?)?(?:Z|[+-]\d\d:?\d\d)?",
    re.ASCII,
)
_SETTING = re.compile(r"[=]|:(?!\s*$)")
_LONGEST_NAME = 5  # maximum number of words
_BRACKETED = re.compile(r"\([^()]*\)|\[[^\[\]]*\]")
_SLASH = re.compile(r"(?P<name>.*?\S)\s*/\s*(?P<unit>[^\s/]+(?:/[^\s/]+)?)")
_TAIL = re.compile(r"(?P<name>.*?[^\W_])(?:[_ ](?:in )?|,\s*|:)(?P<unit>[^\W_]+(?:/s(?:ec)?(?:\^?2|²)?)?|°(?:/s)?)")
_IN = re.compile(r"(?P<name>.*?\S)\s+in\s+(?P<unit>\S+)")
_NO_TAIL = frozenset(("1", "in", "g", "mg"))
"""Units that often end a name without being its unit: ``V_in``, ``x_1``."""
_TOKEN = re.compile(r"[^\s(\[]+(?:\s*[(\[][^)\]]*[)\]])?")


@dataclass(frozen=True, slots=True)
class TableLayout:
    """The layout of a table in a text.

    Parameters
    ----------
    preamble : tuple of str
        Lines above the headings.
    headings : tuple of Heading
        One heading for each column; the names are empty if no line names the columns.
    spare : tuple of (str, str)
        Names beyond the last column, each with the cell below it in the line of units.
    line : Line
        The first row.
    mark : str
        The separator of cells; empty for runs of white space.
    brackets : bool
        Whether rows end in semicolons and may be in brackets.
    rows : tuple of tuple of str
        Cells of the first rows, which all have the same number of cells.
    """

    preamble: tuple[str, ...]
    headings: tuple[Heading, ...]
    spare: tuple[tuple[str, str], ...]
    line: Line
    mark: str
    brackets: bool
    rows: tuple[tuple[str, ...], ...]

    @property
    def named(self) -> bool:
        """Whether a line names the columns."""
        return any(each.name for each in self.headings)


def find_table(lines: Sequence[Line]) -> TableLayout | None:
    """Find the first rows of numbers in a text, and the names of their columns; None if there are none.

    Rows are lines in which each column contains either only numbers or only words, apart from empty cells. The chosen
    separator gives the earliest rows; among several such separators, it is one that also fits a line of names.

    Examples
    --------
    >>> lines = ["A title", "Tempo,Pos", "0,00\\t1,5", "0,02\\t1,7", "0,04\\t1,8"]
    >>> found = find_table([Line(i, 0, 0, text) for i, text in enumerate(lines, 1)])
    >>> [each.name for each in found.headings], found.line.number, found.preamble
    (['Tempo', 'Pos'], 3, ('A title',))
    """
    return _find_table(tuple(lines))


@lru_cache(maxsize=1)  # the same table is needed twice: to recognise a file, and to read it
def _find_table(lines: tuple[Line, ...]) -> TableLayout | None:
    best: tuple[tuple[int, bool, int], _Split, _Rows, TableLayout] | None = None
    for order, mark in enumerate(_MARKS):
        if order and mark and not any(mark in each.text for each in lines):
            continue  # each line would be a single cell, a case that the first separator has covered
        split = _Split(lines, mark)
        if (rows := split.first_rows()) is not None:
            table = _with_names(lines, rows.start, mark, split.brackets, rows.width)
            trial = (rows.start, not table.named, order), split, rows, table
            best = trial if best is None else min(best, trial, key=lambda each: each[0])
    return None if best is None else replace(best[3], rows=best[1].all_rows(best[2]))


def _cells(line: str, mark: str, brackets: bool) -> list[str]:
    if '"' in line and mark and not brackets:
        return [cell.strip() for cell in split_heading(line, mark)[0]]
    cells = split_cells(_BRACKETS.sub(" ", line) if brackets else line, mark)
    return [cell[1:-1].strip() if len(cell) > 1 and cell[0] == cell[-1] == '"' else cell for cell in cells]


def _kind(cell: str) -> str:
    if not cell:
        return ""
    if parse_number(cell) is not None:
        return "number"
    if _CLOCK.fullmatch(cell):
        return "clock"
    if _DATE.fullmatch(cell):
        return "text"
    return "mixed" if _NUMBERS.fullmatch(cell) else "text"


class _Rows(NamedTuple):
    """The first rows: index of the first, kinds of its cells, maximum number of cells, and later non-empty lines."""

    start: int
    first: list[str]
    width: int
    filled: list[int]


class _Split:
    """Lines that are split into cells by one separator; a line is split when it is first needed."""

    def __init__(self, lines: Sequence[Line], mark: str) -> None:
        self.lines, self.mark = lines, mark
        ends = 0 if mark else sum(each.text.rstrip().endswith(";") for each in lines)
        self.brackets = ends > len(lines) / 2  # as in a MATLAB matrix
        self._split: dict[int, tuple[list[str], list[str]]] = {}

    def at(self, line: int) -> tuple[list[str], list[str]]:
        """Return the cells of a line and their kinds."""
        if line not in self._split:
            cells = _cells(self.lines[line].text, self.mark, self.brackets)
            self._split[line] = cells, [_kind(cell) for cell in cells]
        return self._split[line]

    def first_rows(self) -> _Rows | None:
        """Return the first rows; None if there are none."""
        blanks = self.mark + " " if self.mark else "\t [];" if self.brackets else "\t "
        filled = [at for at, each in enumerate(self.lines) if each.text.strip(blanks)]
        for position, start in enumerate(filled):
            cells, first = self.at(start)
            if not _is_row(first) or any("=" in cell for cell in cells):
                continue
            probe = [self.at(at)[1] for at in filled[position : position + _PROBE]]
            width = max((len(kinds) for kinds in probe if _is_row(kinds)), default=0) if self.mark else len(first)
            like = [_alike(kinds, first, width, self.mark) for kinds in probe]
            if sum(like[:_FEWEST]) == _FEWEST and sum(like) >= _SOUND * len(like):
                return _Rows(start, first, width, filled[position:])
        return None

    def all_rows(self, rows: _Rows) -> tuple[tuple[str, ...], ...]:
        """Return the cells of every line that is like the first row."""
        split = (self.at(at) for at in rows.filled)
        like = [cells for cells, kinds in split if _alike(kinds, rows.first, rows.width, self.mark)]
        return tuple(tuple(cells + [""] * (rows.width - len(cells))) for cells in like)


def _is_row(kinds: Sequence[str]) -> bool:
    values = kinds.count("number") + kinds.count("clock")
    return "number" in kinds and values >= kinds.count("text") and "mixed" not in kinds


def _alike(kinds: Sequence[str], first: Sequence[str], width: int, mark: str) -> bool:
    """Return whether a line is a row like the first: text below text, numbers below numbers, or empty cells."""
    if not _is_row(kinds) or (not mark and len(kinds) != width) or len(kinds) > width:
        return False
    return all(a == b or "" in (a, b) for a, b in zip(kinds, first, strict=False))


def _with_names(lines: Sequence[Line], start: int, mark: str, brackets: bool, width: int) -> TableLayout:
    """Return the layout of a table whose first row is known, without its rows."""
    above = [at for at in range(start - 1, -1, -1) if lines[at].text.strip(_COMMENT)][:_ABOVE]
    names, units, at_names = [""] * width, [""] * width, start
    spare: tuple[tuple[str, str], ...] = ()
    for at in above:
        cells = _names(lines[at].text, mark, width, numbered=at_names < start)
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
        plain, own = heading_of(name)
        headings.append(Heading(plain, own or unit.strip(" ()[]")))
    preamble = tuple(text for each in lines[:at_names] if (text := each.text.strip(_COMMENT + "\t")))
    return TableLayout(preamble, tuple(headings), spare, lines[start], mark, brackets, ())


def _names(line: str, mark: str, width: int, *, numbered: bool = False) -> list[str]:
    """Split a line into one name for each column; return an empty list if that is impossible.

    At least half of the names must be words, or one name if channels may be ``numbered``. For a single column, a
    setting or a sentence is not a name.
    """
    plain = line.lstrip(_COMMENT).rstrip().removeprefix("DEF=")
    if width == 1 and (_SETTING.search(plain) or len(plain.split()) > _LONGEST_NAME):
        return []
    for cells in _splits(plain, mark, width):
        words = [cell for cell in cells if cell and parse_number(cell) is None and not _CLOCK.fullmatch(cell)]
        if words and (numbered or 2 * len(words) >= len([cell for cell in cells if cell])):
            return cells
    return []


def _splits(line: str, mark: str, width: int) -> Iterator[list[str]]:
    """Yield the possible splits of a line into cells, with the most likely split first."""
    by_mark = split_heading(line) if any(each in line for each in "\t;,") else ([line], "")
    own = [cell.strip().strip('"') for cell in line.split(mark)] if mark and '"' not in line else by_mark[0]
    if mark and mark in line:
        while len(own) > width and not own[-1]:
            own.pop()
        if len(own) >= width or 2 * len(own) > width > 2:
            yield own
        return
    if len(by_mark[0]) == width and (width > 1 or by_mark[1] == ""):
        yield by_mark[0]
    apart = [re.split(r"\s{2,}|\t", line), [each.group() for each in _TOKEN.finditer(line)], line.split()]
    yield from (each for each in apart if len(each) == width)
    # More names than columns are accepted only if the names are short.
    tokens = line.split()
    if not mark and width < len(tokens) <= 3 * width and all(len(each) < 6 for each in tokens):
        yield tokens


def _are_units(cells: Sequence[str]) -> bool:
    """Return whether a line contains units: at least half of its words are units or bracketed, and none means time."""
    filled = [cell for cell in cells if cell]
    known = [
        measure_of(plain) is not None or time_power(plain) is not None or bool(_BRACKETED.fullmatch(cell))
        for cell in filled
        if parse_number(cell) is None
        for plain in (cell.strip(" ()[]"),)
    ]
    return bool(known) and sum(known) * 2 >= len(known) and not any(is_time(cell) for cell in filled)


def heading_of(cell: str) -> tuple[str, str]:
    """Split a heading into name and unit: the unit is in brackets, after a slash, or after a last underscore.

    Examples
    --------
    >>> heading_of("Zeit t / s"), heading_of("theta_rad"), heading_of("x_rojo"), heading_of("Time(sec)")
    (('Zeit t', 's'), ('theta', 'rad'), ('x_rojo', ''), ('Time', 'sec'))
    >>> heading_of("Position in mm"), heading_of("Volt, V"), heading_of("gx_dps"), heading_of("V_in")
    (('Position', 'mm'), ('Volt', 'V'), ('gx', 'dps'), ('V_in', ''))
    """
    name, unit = name_and_unit(cell)
    if unit:
        return name, unit
    for form in (_SLASH, _TAIL, _IN):
        match = form.fullmatch(name)
        if match and (form is _SLASH or _ends(match["name"], match["unit"])):
            return match["name"].strip(), match["unit"].strip()
    return name, ""


def _ends(name: str, unit: str) -> bool:
    """Return whether the end of a name is its unit; h is a unit only for a time."""
    if unit in _NO_TAIL or (unit == "h" and not is_time(name)):
        return False
    return measure_of(unit) is not None or time_power(unit) is not None


def clock_s(cell: str) -> tuple[str, float, int] | None:
    """Parse a time of day: printed date, second of the day, number of decimals; return None for any other text.

    Examples
    --------
    >>> clock_s("10:04:59.812"), clock_s("01/08/2024 1:00:36 pm"), clock_s("0.5")
    (('', 36299.812, 3), ('01/08/2024', 46836.0, 0), None)
    """
    match = _CLOCK.fullmatch(cell)
    if match is None:
        return None
    hour = int(match["h"] or 0)
    hour = hour % 12 + 12 * (match["half"][0] in "pP") if match["half"] else hour
    seconds = (match["s"] or match["s2"] or "0").replace(",", ".")
    decimals = len(seconds.partition(".")[2])
    at = hour * 3600 + int(match["m"] or match["m2"]) * 60 + float(seconds)
    return (match["date"] or "").strip(" ,T"), round(at, decimals), decimals
