"""A buffer for samples that arrive piece by piece."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray


class GrowingColumns:
    """Columns of numbers that grow together; the room doubles, so that the cost per row stays constant.

    ``total`` counts the rows that came. Rows that were handed out never change, so one thread may read while another
    appends, but not while it keeps only some rows.
    """

    def __init__(self, *kinds: DTypeLike) -> None:
        self._columns: list[NDArray[Any]] = [np.empty(1024, kind) for kind in kinds]
        self._count = self.total = 0

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, rows: slice) -> list[NDArray[Any]]:
        count = self._count
        return [column[:count][rows] for column in self._columns]

    def append(self, t: NDArray[Any], *others: ArrayLike) -> None:
        """Append rows: the values of the first column, and those of the others, of which a single one is repeated."""
        stop = self._count + t.size
        if stop > self._columns[0].size:
            room = max(stop, 2 * self._columns[0].size) - self._count
            self._columns = [np.concatenate([c[: self._count], np.empty(room, c.dtype)]) for c in self._columns]
        for column, new in zip(self._columns, (t, *others), strict=True):
            column[self._count : stop] = new
        self._count, self.total = stop, self.total + t.size  # last, because another thread may read

    def keep(self, rows: slice) -> None:
        """Keep only some rows, in new arrays."""
        self._columns = [column.copy() for column in self[rows]]
        self._count = self._columns[0].size
