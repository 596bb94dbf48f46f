"""Cells found without a search for separators: from the start of each line on, by the lengths of the first one's cells.

Where a column prints fixed point, its cells differ in length by a sign and now and then by a digit. So a cell ends
where the first line's would, or a character or two beside, and a separator stands there. That none stands before,
reading the cell shows: what lies between is digits.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from acquisition.block import I8
from acquisition.recordings.tables.fixed_point import Page
from acquisition.recordings.tables.line_pages import NEWLINE, RETURN, starts_of

__all__ = ["line_starts", "walk"]

_MINUS = ord("-")
_BESIDE = 1, -1, 2, -2

Mask = NDArray[np.bool_]


def line_starts(page: Page, returns: bool) -> I8 | None:
    """Return where each line of a page starts, among which there may be ``returns``; None where a CR stands alone."""
    count = int(np.count_nonzero(page.equal(RETURN))) if returns else 0
    ends = page.places(NEWLINE)
    if count and (count != ends.size or (page.raw.take(ends - 1, mode="clip") != RETURN).any()):
        return None
    return starts_of(ends)


def walk(page: Page, first: Sequence[tuple[int, int]], start: I8) -> Iterator[tuple[I8, I8, Mask | None] | None]:
    """Yield where the cells of one column after the other may be; they are there if each is a number and nothing else.

    Parameters
    ----------
    page : Page
    first : sequence of (int, int)
        Where each of the cells begins and ends in the first line.
    start : (n,) int64
        Where each line starts.

    Yields
    ------
    end : (n,) int64
    length : (n,) or (1,) int64
        Characters of each, without a minus; one number if all have as many.
    negative : (n,) bool or None
        Cells that begin with a minus; None where none does.

    Or None, and no more, where some cells are not to be found.
    """
    raw, begin = page.raw, start
    for first_begin, first_end in first:
        closer = raw[first_end]
        length = np.array([first_end - first_begin - int(raw[first_begin] == _MINUS)])
        negative = raw.take(begin, mode="clip") == _MINUS
        signed = bool(negative.any())
        end = begin + length
        if signed:
            end += negative
        missed = raw.take(end, mode="clip") != closer
        if missed.any():
            if not _look_beside(page, end, missed, closer):
                yield None
                return
            length = end - begin
            if signed:
                length -= negative
        if int(end.max()) >= raw.size:
            yield None
            return
        yield end, length, negative if signed else None
        begin = end + 1


def _look_beside(page: Page, end: I8, missed: Mask, closer: np.uint8) -> bool:
    """Move the ends of cells that do not end there, in place; tell whether an end was found for all."""
    rows = np.flatnonzero(missed)
    for step in _BESIDE:
        at = end[rows] + step
        found = page.raw.take(at, mode="clip") == closer
        end[rows[found]] = at[found]
        rows = rows[~found]
        if not rows.size:
            return True
    return False
