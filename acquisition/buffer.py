"""Buffers for samples that arrive piece by piece."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from acquisition.block import Block


class GrowingColumns:
    """Columns of numbers that grow together; the room doubles, so that the cost per row stays constant.

    Rows that were handed out never change, and one thread may read them while another appends.
    """

    def __init__(self, *kinds: DTypeLike) -> None:
        self._columns: list[NDArray[Any]] = [np.empty(1024, kind) for kind in kinds]
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, rows: slice) -> list[NDArray[Any]]:
        """Return some rows of each column."""
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
        self._count = stop  # last, because another thread may read

    def keep(self, rows: slice) -> None:
        """Keep only some rows, in new arrays; no other thread may read meanwhile."""
        self._columns = [column.copy() for column in self[rows]]
        self._count = self._columns[0].size


class SampleBuffer(GrowingColumns):
    """The samples of one sensor so far, or only the latest ``most``; ``pushed`` is the number of all that came."""

    def __init__(self, most: int | None = None) -> None:
        super().__init__(float, float, np.uint8, np.int64)
        self._most = most
        self.pushed = 0

    def push(self, block: Block) -> None:
        """Append samples; without host times, these are -1."""
        self.append(block.t, block.distance, block.flags, -1 if block.host_ns is None else block.host_ns)
        if self._most is not None and len(self) > 2 * self._most:
            self.keep(slice(-self._most, None))
        self.pushed += len(block)

    def block(self) -> Block:
        """Return the samples as they are now."""
        t, distance, flags, host_ns = self[slice(None if self._most is None else -self._most, None)]
        return Block(0, t, distance, flags, host_ns)
