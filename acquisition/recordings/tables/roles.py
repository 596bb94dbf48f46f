"""What the columns of a table are: times, row numbers, uncertainties, or what was measured."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from acquisition.block import F8
from acquisition.recordings.tables.contents import Heading, is_time, is_uncertainty
from acquisition.recordings.tables.text import parse_number
from acquisition.recordings.units import time_power

__all__ = ["are_row_numbers", "columns_of", "is_aside", "runs_forward", "times_by_name", "times_by_steps"]

_NUMBERED = re.compile(r".*(index|sample|frame|number|count|row|seq)s?", re.IGNORECASE)
_INDEX = frozenset(("", "n", "i", "nr", "no", "index", "sample", "samples", "frame", "row", "step", "id", "count", "#"))
_FIRST_NUMBERS = 10  # rows that are not like the others may stand before the first that is read
_NEUTRAL = re.compile(
    r"|x|(?-i:t)|x[-_ ]?(axis|value|achse)|(column|col|spalte|colonna|columna|var|field|unnamed:)[-_ ]?\d+",
    re.IGNORECASE,
)
"""Names that say nothing against a column of times."""
_SPAN = re.compile(r"^(?-i:T)\b|^[Ττ]|period|durat|dauer|half|halb|interval|tau|delay|[dΔ]t|mean|10", re.IGNORECASE)
"""Names of times that are no clock: how long something took."""
_SPARSE = 0.2  # a column with numbers in fewer of its rows is none of samples
_CAPITAL = re.compile(r"(?<![^\W\d_])T(?![^\W\d_])")


def columns_of(rows: Sequence[Sequence[str]]) -> list[F8]:
    """Return the numbers of each column; NaN where a cell is none."""
    read = [[parse_number(cell) for cell in row] for row in rows]
    return [np.array([np.nan if x is None else x for x in column]) for column in zip(*read, strict=True)]


def are_row_numbers(column: F8) -> bool:
    """Tell whole numbers one by one, from one of the first."""
    return bool(column.size > 1 and column[0] in range(_FIRST_NUMBERS) and (np.diff(column) == 1.0).all())


def runs_forward(column: F8) -> bool:
    """Tell a column that rises, but for a few rows."""
    told = column[np.isfinite(column)]
    steps = np.diff(told)
    return bool(told.size >= 3 and told[-1] > told[0] and np.mean(steps >= 0) >= 0.95 and np.mean(steps > 0) >= 0.5)


def _is_even(column: F8) -> bool:
    steps = np.diff(column[np.isfinite(column)])
    usual = float(np.median(steps))
    return bool(usual > 0 and np.mean(np.abs(steps - usual) <= 0.5 * usual) >= 0.8)


def is_aside(heading: Heading, column: F8, others: bool) -> bool:
    """Tell row numbers and uncertainties, which are there for the sake of other columns, and columns nearly empty.

    Parameters
    ----------
    heading : Heading
    column : (n,) float64
        Its first rows.
    others : bool
        Whether there are other columns to tell times.
    """
    name = " ".join(heading.name.lower().replace("_", " ").split())
    index = others and are_row_numbers(column) and (name in _INDEX or bool(_NUMBERED.fullmatch(name)))
    return index or is_uncertainty(name) or bool(np.mean(np.isfinite(column)) < _SPARSE)


def times_by_name(headings: Sequence[Heading], columns: Sequence[F8]) -> list[int]:
    """Return the columns that are called time, or whose first is in a unit of time, and that run forward.

    A capital T alone is a period as often as a time.
    """
    named = [
        column
        for column, each in enumerate(headings)
        if (is_time(each.name) and not _CAPITAL.search(each.name) and not (each.unit and time_power(each.unit) is None))
        or (column == 0 and time_power(each.unit) is not None and not _SPAN.search(each.name) and _is_even(columns[0]))
    ]
    return [column for column in named if runs_forward(columns[column])]


def times_by_steps(headings: Sequence[Heading], columns: Sequence[F8]) -> int | None:
    """Return the column that must be the times because it alone runs forward; None where none is, or several are.

    A name, or a unit, that is of something else speaks against it; of row numbers nobody knows the step.
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
    for found in (even, fit):
        if len(found) == 1:
            return found[0]
    return None
