"""Check the available memory before the live analysis loads its libraries.

A linear-algebra library that is loaded when memory has run out retries forever and blocks the interpreter. Nothing else
in the program then runs, including the recording. The memory is therefore first requested as one block, which is
released untouched.
"""

from __future__ import annotations

import mmap

__all__ = ["ROOM_BYTES", "demand_room"]

ROOM_BYTES = 512 << 20
"""Address space for the analysis: 230 MiB was measured on two cores, and each further core takes about 40 MiB."""


def demand_room(size: int = ROOM_BYTES) -> None:
    """Raise MemoryError if this many bytes are not available.

    Examples
    --------
    >>> demand_room(1 << 20)
    """
    try:
        # Private, like the memory of the libraries, because a limit on a program's data ignores shared memory.
        private = {"flags": mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS} if hasattr(mmap, "MAP_PRIVATE") else {}
        mmap.mmap(-1, size, **private).close()
    except OSError as error:
        raise MemoryError(f"{size >> 20} MiB are not available") from error
