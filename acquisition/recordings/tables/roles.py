"""Find the roles of the columns of a table: times, row numbers, uncertainties, or measured values."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from acquisition.block import F8
from acquisition.recordings.tables.cells import parse_number
from acquisition.recordings.tables.headings import Heading, is_time, is_uncertainty
from acquisition.recordings.units import time_power

_NUMBERED = re.compile(r".*(index|sample|frame|number|count|row|seq)s?", re.IGNORECASE)
_INDEX = frozenset(("", "n", "i", "nr", "no", "index", "sample", "samples", "frame", "row", "step", "id", "count", "#"))
_FIRST_NUMBERS = 10  # row numbers begin below this; the first may be missing, in rows unlike the others
_NEUTRAL = re.compile(
    r"|x|(?-i:t)|x[-_ ]?(axis|value|achse)|(column|col|spalte|colonna|columna|var|field|unnamed:)[-_ ]?\d+",
    re.IGNORECASE,
)
"""Names that do not prevent a column from being read as the times."""
_SPAN = re.compile(r"^(?-i:T)\b|^[Ττ]|period|durat|dauer|half|halb|interval|tau|delay|[dΔ]t|mean|10", re.IGNORECASE)
"""Names of durations, which are not times of samples."""
_SPARSE = 0.2  # minimum share of rows with a number in a column of samples
_CAPITAL = re.compile(r"(?<![^\W\d_])T(?![^\W\d_])")


def columns_of(rows: Sequence[Sequence[str]]) -> list[F8]:
    """Return the numbers of each column; NaN for cells that are not numbers."""
    read = [[parse_number(cell) for cell in row] for row in rows]
    return [np.array([np.nan if x is None else x for x in column]) for column in zip(*read, strict=True)]


def are_row_numbers(column: F8) -> bool:
    """Return whether a column starts at a small number and increases by one in every row."""
    return bool(column.size > 1 and column[0] in range(_FIRST_NUMBERS) and (np.diff(column) == 1.0).all())


def runs_forward(column: F8) -> bool:
    """Return whether a column rises in all but a few rows."""
    known = column[np.isfinite(column)]
    steps = np.diff(known)
    return bool(known.size >= 3 and known[-1] > known[0] and np.mean(steps >= 0) >= 0.95 and np.mean(steps > 0) >= 0.5)


def _is_even(column: F8) -> bool:
    steps = np.diff(column[np.isfinite(column)])
    usual = float(np.median(steps))
    return bool(usual > 0 and np.mean(np.abs(steps - usual) <= 0.5 * usual) >= 0.8)


def is_aside(heading: Heading, column: F8, others: bool) -> bool:
    """Return whether a column is row numbers (if ``others`` may be the times), an uncertainty, or nearly empty."""
    name = " ".join(heading.name.lower().replace("_", " ").split())
    index = others and are_row_numbers(column) and (name in _INDEX or bool(_NUMBERED.fullmatch(name)))
    return index or is_uncertainty(name) or bool(np.mean(np.isfinite(column)) < _SPARSE)


def times_by_name(headings: Sequence[Heading], columns: Sequence[F8]) -> list[int]:
    """Return the rising columns that are named as times, and the first column if its even steps have a unit of time.

    A capital T is not accepted as a name of times, because it often denotes a period.
    """
    named = [
        column
        for column, each in enumerate(headings)
        if (is_time(each.name) and not _CAPITAL.search(each.name) and not (each.unit and time_power(each.unit) is None))
        or (column == 0 and time_power(each.unit) is not None and not _SPAN.search(each.name) and _is_even(columns[0]))
    ]
    return [column for column in named if runs_forward(columns[column])]


def times_by_steps(headings: Sequence[Heading], columns: Sequence[F8]) -> int | None:
    """Return the column that must be the times because of its steps; None if there is no such column.

    This is the first column if it rises in even steps, else the only column that does so, else the only column that
    rises. Row numbers are not considered, because their step is unknown. Neither are columns whose name or unit
    denotes something else.
    """
    fit = [
        column
        for column, each in enumerate(headings)
        if _NEUTRAL.fullmatch(each.name) and (not each.unit or time_power(each.unit) is not None)
        if runs_forward(columns[column]) and not are_row_numbers(columns[column])
    ]
    even = [column for column in fit if _is_even(columns[column])]
    if even and even[0] == 0:
        return 0
    for choice in (even, fit):
        if len(choice) == 1:
            return choice[0]
    return None
