"""The grammar of times: clock times and dates as seconds since the first one."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from acquisition.block import B1, F8
from acquisition.recordings.tables.numbers import I1, UNREAD_CELL
from acquisition.recordings.tables.table import Column

CLOCK = re.compile(
    r"'?(?P<date>\d{1,4}[-./]\d{1,2}[-./]\d{1,4}[T ,]*)?"
    r"(?:(?P<h>\d{1,2}):(?P<m>\d{1,2}):(?P<s>\d{1,2})(?:[.,](?P<part>\d{1,9})|::?(?P<ms>\d{1,3}))?"
    r"|(?P<h2>\d{1,2}):(?P<m2>\d\d)|(?P<m3>\d{1,2}):(?P<s3>\d\d)[.,](?P<part3>\d{1,9}))"
    r"\s*(?P<half>[aApP]\.?[mM]\.?)?(?:Z|[+-]\d\d:?\d\d)?",
    re.ASCII,
)


def clock_s(cell: str) -> tuple[str, float, int] | None:
    """Return the printed date, the second of the day and the number of decimals; None for any other text."""
    match = CLOCK.fullmatch(cell)
    if match is None:
        return None
    hour = int(match["h"] or match["h2"] or 0)
    hour = hour % 12 + 12 * (match["half"][0] in "pP") if match["half"] else hour
    part = f"{match['ms']:0>3}" if match["ms"] else match["part"] or match["part3"] or ""
    decimals = len(part)
    seconds = float(f"{match['s'] or match['s3'] or 0}.{part}")
    at = hour * 3600 + int(match["m"] or match["m2"] or match["m3"]) * 60 + seconds
    return (match["date"] or "").strip(" ,T"), round(at, decimals), decimals


def clock_times(cells: Sequence[bytes]) -> tuple[F8, I1, B1]:
    """Return times of day in seconds, the decimals of each, and a mask without commas, as :func:`read_cells` does."""
    values, decimals = np.full(len(cells), np.nan), np.full(len(cells), UNREAD_CELL, np.int8)
    for row, each in enumerate(cells):
        if (time := clock_s(each.strip(b'"').decode("latin-1"))) is not None:
            _, values[row], decimals[row] = time
    return values, decimals, np.zeros(values.size, bool)


def count_from_first(column: Column) -> None:
    """Make times of day seconds since the first one, in place; midnight may lie between them."""
    filled = np.flatnonzero(column.forms >= 0)
    if filled.size:
        at = column.values[filled]
        days = np.concatenate(([0.0], np.cumsum(np.diff(at) < -43200.0)))
        column.values[filled] = np.round(at - at[0] + 86400.0 * days, column.forms[filled].max())
