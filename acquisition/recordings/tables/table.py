"""Tables: columns of numbers as printed, and where their times come from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.block import B1, F8, I8
from acquisition.recordings.recording import FormatIssue
from acquisition.recordings.sampling.timing import Formula
from acquisition.recordings.tables.headings import Heading, role_of, unique
from acquisition.recordings.tables.numbers import EMPTY_CELL, I1
from acquisition.recordings.tables.vocabulary import ACCELERATION
from acquisition.units import Measure, measure_of


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """One column of numbers.

    Parameters
    ----------
    name : str
        Its name in the file, without the unit.
    unit : str
        Unit as printed in the file; empty if the file states none.
    values : (n,) float64
        The numbers as printed; NaN for a cell that is not a number.
    decimals : (n,) int8 or None
        The printed decimals of each number, plus 64 if it has an exponent; -1 for the word NaN, -2 for an empty cell,
        -3 for a cell that is not a number. None for binary numbers.
    aside : bool
        Whether it is an auxiliary column (row numbers, an uncertainty), which is read only if the user names it.
    words : (n,) array of str or None
        The text of its cells, if it says to which recording a row belongs.
    differences : bool
        Whether each value is the difference from the row before, so that the first may be absent.
    """

    name: str
    unit: str
    values: F8
    decimals: I1 | None = None
    aside: bool = False
    words: NDArray[np.str_] | None = None
    differences: bool = False

    @property
    def forms(self) -> I1:
        """The decimals of a column of a text."""
        if self.decimals is None:
            raise ValueError("binary numbers have no decimals")
        return self.decimals

    @property
    def label(self) -> str:
        """Name and unit, as a user may write them."""
        return f"{self.name} ({self.unit})" if self.unit else self.name

    @property
    def measure(self) -> Measure | None:
        """The measure of its unit; None for an unknown unit.

        The unit g means standard gravity if the name denotes an acceleration; otherwise it means gram.
        """
        measure = measure_of(self.unit if self.unit != "G" else "g")
        grams = measure is not None and measure.symbol in ("g", "mg") and not ACCELERATION.search(self.name)
        return None if grams else measure

    @property
    def is_length(self) -> bool:
        """Whether its unit is a length."""
        return self.measure is not None and self.measure.quantity == "length"

    def taken(self, rows: I8) -> Column:
        """Return its rows with these numbers, as far as it has them."""
        rows = rows[rows < self.values.size]
        decimals = None if self.decimals is None else self.decimals[rows]
        words = None if self.words is None else self.words[rows]
        return replace(self, values=self.values[rows], decimals=decimals, words=words)

    def of_size(self, size: int) -> Column:
        """Return the column with empty cells up to a size."""
        more = size - self.values.size
        if more <= 0:
            return self
        decimals = (
            None if self.decimals is None else np.concatenate((self.decimals, np.full(more, EMPTY_CELL, np.int8)))
        )
        return replace(self, values=np.concatenate((self.values, np.full(more, np.nan))), decimals=decimals)


class Lines(NamedTuple):
    """Where rows stand in a text.

    ``numbers`` are the one-based numbers of their lines. ``words`` marks rows that begin with text. ``ended`` says that
    the last row has a line end, ``cut`` that it is incomplete. ``zeros`` is the number of zero bytes that were left out
    at the end of the file.
    """

    numbers: I8
    words: B1
    ended: bool = True
    cut: bool = False
    zeros: int = 0

    @property
    def rows(self) -> int:
        """The number of rows."""
        return int(self.words.size)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TableFacts:
    """What the lines above the rows may say of all channels, and a :class:`Header` and a :class:`Table` share.

    Parameters
    ----------
    formula : Formula or None
        The times. If there is a column of times too, the column decides where the two differ.
    run, title, start_time : str
        Name of the run, title of the file, start time in ISO 8601; empty if the file does not state them.
    ragged : bool
        Whether a channel may end before its times, because longer channels share them.
    traps : tuple of FormatIssue
        Remarks on the file as a whole.
    unread_times : str
        Why a column that is named as times is not used; empty if there is none.
    """

    formula: Formula | None = None
    run: str = ""
    title: str = ""
    start_time: str = ""
    ragged: bool = False
    traps: tuple[FormatIssue, ...] = ()
    unread_times: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Header(TableFacts):
    """What the lines above the rows of a text say; further keywords are those of :class:`TableFacts`.

    Parameters
    ----------
    why : str
        A few words on why the text belongs to its family.
    lines : int
        Number of lines above the rows.
    delimiter : str
        The separator of cells; empty for runs of white space.
    headings : sequence of Heading
        One for each column.
    clocks : tuple of int
        Columns of times of day or durations.
    words : tuple of int
        Columns of text that may hold the units of each row, or tell its rows apart.
    refused : tuple of str or None
        Why the rows cannot be read, and what to do.
    rows : tuple of tuple of str
        The cells of the first rows, if the header was found by them; all have the same number of cells.
    """

    why: str
    lines: int
    delimiter: str
    headings: Sequence[Heading]
    clocks: tuple[int, ...] = ()
    words: tuple[int, ...] = ()
    refused: tuple[str, str] | None = None
    rows: tuple[tuple[str, ...], ...] = ()

    @property
    def named(self) -> bool:
        """Whether a line names the columns."""
        return any(each.name for each in self.headings)


@dataclass(frozen=True, slots=True, eq=False)
class Table(TableFacts):
    """Columns of one run that share their times; further keywords are those of :class:`TableFacts`.

    Parameters
    ----------
    columns : tuple of Column
        The columns that may be read as channels.
    times : Column or None
        The column of their times. Without one, the formula gives the times, or else the user must give the rate.
    lines : Lines or None
        Where the rows stand; None for a file that is not text.
    beside : tuple of Column
        All columns of the rows; the user may name any of them as the times.
    """

    columns: tuple[Column, ...]
    times: Column | None = None
    lines: Lines | None = None
    beside: tuple[Column, ...] = ()

    @property
    def is_timed(self) -> bool:
        """Whether the file states its times."""
        return self.times is not None or self.formula is not None


def side_by_side(table: Table, headings: Sequence[Heading], run: str = "") -> list[Table]:
    """Return the tables of a table's columns: each column has the times to its left, or else the first of its run.

    If any heading names a run, columns without a heading are ignored.
    """
    none = Column("", "", np.empty(0), np.empty(0, np.int8))  # a heading without cells
    read = [*table.columns, *[none] * (len(headings) - len(table.columns))]
    roles, runs = [role_of(each) for each in headings], any(each.run for each in headings)
    columns = tuple(
        replace(column, name=each.name or f"column {number}", unit=each.unit, aside=role == "aside")
        for number, (column, each, role) in enumerate(zip(read, headings, roles, strict=False), 1)
    )
    times = {headings[at].run: at for at in reversed(range(len(headings))) if roles[at] == "time"}
    channels: dict[tuple[str, int | None], list[Column]] = {}
    for at, (each, role) in enumerate(zip(headings, roles, strict=True)):
        if role == "time":
            times[each.run] = at
        elif role != "ignored" and (each.name or each.run or not runs):
            channels.setdefault((each.run, times.get(each.run)), []).append(columns[at])
    return [
        replace(
            table,
            columns=tuple(of_channel),
            times=None if time is None else columns[time],
            run=own_run or run,
            beside=columns,
        )
        for (own_run, time), of_channel in channels.items()
    ]


def names_apart(tables: Sequence[Table]) -> list[Table]:
    """Return tables whose channels have unique names within each run, so that each can be chosen."""
    taken: dict[str, set[str]] = {table.run: set() for table in tables}
    return [
        replace(table, columns=tuple(replace(each, name=unique(each.name, taken[table.run])) for each in table.columns))
        for table in tables
    ]
