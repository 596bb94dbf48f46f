"""Room in memory, asked for before the live analysis loads its libraries.

A library of linear algebra that is loaded where memory has run out tries for ever, and holds the interpreter: nothing
else of the program runs, the recording included. So the room is asked for first, as one piece that is given back
untouched.
"""

from __future__ import annotations

import mmap

__all__ = ["ROOM_BYTES", "demand_room"]

ROOM_BYTES = 512 << 20
"""What the analysis may take of address space: 230 MiB were measured on two cores, and each core more takes some 40."""


def demand_room(size: int = ROOM_BYTES) -> None:
    """Raise MemoryError where so many bytes are not to be had.

    Examples
    --------
    >>> demand_room(1 << 20)
    """
    try:
        # Private, as what the libraries take: a limit on a program's data does not count what is shared.
        private = {"flags": mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS} if hasattr(mmap, "MAP_PRIVATE") else {}
        mmap.mmap(-1, size, **private).close()
    except OSError as error:
        raise MemoryError(f"{size >> 20} MiB are not available") from error
