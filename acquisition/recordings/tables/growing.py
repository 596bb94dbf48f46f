"""An array that grows as a file is read, and takes no room while all that it holds is one number."""

from __future__ import annotations

from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = ["Growing"]

_T = TypeVar("_T", bound=np.generic)


class Growing(Generic[_T]):
    """A column, from its first row on.

    Parameters
    ----------
    dtype : type
        Of numpy.

    Examples
    --------
    >>> column = Growing(np.int8)
    >>> column.repeat(3, 2, expected=4)
    >>> column.whole().strides
    (0,)
    >>> column.room(2, expected=4)[:] = 5, 6
    >>> column.whole()
    array([3, 3, 5, 6], dtype=int8)
    """

    __slots__ = ("_array", "_one", "_rows")

    def __init__(self, dtype: type[_T]) -> None:
        self._array: NDArray[_T] = np.empty(0, dtype)
        self._one: _T | None = None
        self._rows = 0

    def repeat(self, number: Any, count: int, expected: int) -> None:
        """Append one number so many times; ``expected`` is how many rows there will be in all."""
        one = self._array.dtype.type(number)
        if not self._rows:
            self._one = one
        if self._one is not None and one.tobytes() == self._one.tobytes():  # zeros differ in sign, NaN equals itself
            self._rows += count
        else:
            self.room(count, expected)[:] = one

    def room(self, count: int, expected: int) -> NDArray[_T]:
        """Append so many rows, and return them to be written to."""
        start, self._rows = self._rows, self._rows + count
        if self._rows > self._array.size:
            longer = np.empty(max(expected, self._rows), self._array.dtype)
            if self._one is None:
                longer[:start] = self._array[:start]
            self._array = longer
        if self._one is not None:
            self._array[:start] = self._one
            self._one = None
        return self._array[start : self._rows]

    def drop(self, count: int) -> None:
        """Take so many rows off the end."""
        self._rows -= count

    def whole(self) -> NDArray[_T]:
        """Return all rows; a read-only view of one number where it is the same in all."""
        if self._one is not None:
            return np.broadcast_to(self._one, self._rows)
        return self._array[: self._rows]
