"""Cells found without a search for separators: from the start of each line on, by the lengths of the first one's cells.

Where a column prints fixed point, its cells differ in length by a sign and now and then by a digit. So a cell ends
where the first line's would, or a character or two beside, and a separator stands there. That none stands before,
reading the cell shows: what lies between is digits.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.block import I8
from acquisition.formats.fixed_point import Page
from acquisition.formats.lines import NEWLINE, RETURN, starts_of

__all__ = ["Cells", "Walk"]

_MINUS = ord("-")
_BESIDE = 1, -1, 2, -2

Mask = NDArray[np.bool_]


class Cells(NamedTuple):
    """Where the cells of one column may be; they are there if each holds a number and nothing else.

    Parameters
    ----------
    end : (n,) int64
    length : (n,) or (1,) int64
        Characters of each, without a minus; one number if all have as many.
    negative : (n,) bool or None
        Cells that begin with a minus; None where none does.
    """

    end: I8
    length: I8
    negative: Mask | None


class Walk(NamedTuple):
    """Lines of a page, and the cells at the begin of the first.

    Parameters
    ----------
    page : Page
    first : tuple of (int, int)
        Where the cells of the first line begin and end that are walked to in every line.
    start : (n,) int64
        Where each line starts.
    """

    page: Page
    first: tuple[tuple[int, int], ...]
    start: I8

    @classmethod
    def of(cls, page: Page, first: tuple[tuple[int, int], ...], returns: bool) -> Walk | None:
        """Find the lines, among which there may be ``returns``; None where a CR stands alone."""
        count = int(np.count_nonzero(page.equal(RETURN))) if returns else 0
        ends = page.places(NEWLINE)
        if count and (count != ends.size or (page.raw.take(ends - 1, mode="clip") != RETURN).any()):
            return None
        return cls(page, first, starts_of(ends))

    def columns(self) -> Iterator[Cells | None]:
        """Yield the cells of one column after the other; None, and no more, where some are not to be found."""
        raw, begin = self.page.raw, self.start
        for first_begin, first_end in self.first:
            length, closer = first_end - first_begin - int(raw[first_begin] == _MINUS), raw[first_end]
            negative = raw.take(begin, mode="clip") == _MINUS
            signed = bool(negative.any())
            end = begin + length
            if signed:
                end += negative
            missed = raw.take(end, mode="clip") != closer
            lengths = np.array([length])
            if missed.any():
                if not _look_beside(self.page, end, missed, closer):
                    yield None
                    return
                lengths = end - begin
                if signed:
                    lengths -= negative
            if int(end.max()) >= raw.size:
                yield None
                return
            yield Cells(end, lengths, negative if signed else None)
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
