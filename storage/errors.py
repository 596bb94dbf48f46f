"""The error tree of storage.

::

    StorageError
    |-- NotARun        nothing there, not HDF5, or HDF5 of another layout     springmass exits with 3
    |-- RunDamaged     a run file whose content is not what was written       springmass exits with 3
    |-- RunClosed      a run used outside its ``with``
    |-- QueryRefused   a question to a catalog that is none, or would change it
    |-- NotALog        nothing there, or no wire log                          springmass exits with 3
    |-- LogGrowing     a log that a recording still writes                    springmass exits with 3
    |-- OutOfMemory    the machine has too little memory; no word against the file   springmass exits with 3
    `-- WriteFailed    a file could not be written; what stood there before stands
        |-- RunExists  a file of that name stands already and may not be replaced
        `-- DiskNearlyFull   too little room for the run, known before it starts

Every message is one line: where, what was demanded, what was got, and what to do.
"""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Iterator
from typing import Any

__all__ = [
    "HDF5_ERRORS",
    "NotARun",
    "OutOfMemory",
    "QueryRefused",
    "RunClosed",
    "RunDamaged",
    "RunExists",
    "StorageError",
    "WriteFailed",
    "damaged",
    "demand_memory",
    "one_line",
    "reading",
]

HDF5_ERRORS = (OSError, KeyError, ValueError, TypeError, RuntimeError, OverflowError, MemoryError)
"""What h5py raises on a wrong checksum, a missing object, a full disk or a value that HDF5 cannot hold."""

_NO_MEMORY = re.compile("memory alloc|alloc[a-z]* memory|out of memory|cannot allocate", re.IGNORECASE)


def one_line(error: BaseException) -> str:
    """Return an error's text on a single line (HDF5 breaks its own over several).

    Examples
    --------
    >>> one_line(OSError("no space\\n  left"))
    'no space left'
    >>> one_line(MemoryError())
    'MemoryError'
    """
    # A KeyError shows its text in quotes.
    text = error.args[0] if isinstance(error, KeyError) and error.args else error
    return " ".join(str(text).split()) or type(error).__name__


class StorageError(Exception):
    """Anything that storage refuses; its text is a single line meant for the user.

    Parameters
    ----------
    path : str or PathLike
        The file.
    demand : str
        What was demanded of it and what was got instead.
    remedy : str
        What the user can do.
    """

    def __init__(self, path: str | os.PathLike[str], demand: str, remedy: str) -> None:
        self.path, self.demand, self.remedy = os.fspath(path), demand, remedy
        super().__init__(f"{self.path}: {demand}; {remedy}")

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how it is made again where it arrives from another process."""
        return type(self), (self.path, self.demand, self.remedy)


class NotARun(StorageError):
    """A path that holds no run file: a missing file, a text, an HDF5 file of another program."""


class RunDamaged(StorageError):
    """A run file whose content is not what was written: a flipped bit, a cut end, an edited attribute."""


class QueryRefused(StorageError):
    """A question to a catalog that is none, names what is not there, or would do anything but read."""


class RunClosed(StorageError):
    """A run read after its ``with`` ended."""


class OutOfMemory(StorageError):
    """A file that this machine has too little memory for; it may be sound."""


class WriteFailed(StorageError):
    """A file that could not be written: a full disk, a missing folder, blocks with a gap between them."""


class RunExists(WriteFailed):
    """A file of that name stands already, and the caller has not said that it may be replaced."""


def damaged(path: str | os.PathLike[str], what: str, how: str) -> RunDamaged:
    """Return the error for a part of a run file that is not what was written."""
    remedy = "restore the file from a copy, or make it again from the wire log or the old recording"
    return RunDamaged(path, f"{what} is not what was written: {how}", remedy)


@contextlib.contextmanager
def reading(path: str | os.PathLike[str], what: str) -> Iterator[None]:
    """Turn what HDF5 raises on damaged bytes into one line."""
    try:
        yield
    except StorageError:
        raise
    except HDF5_ERRORS as error:
        demand_memory(path, error)
        raise damaged(path, what, one_line(error)) from error


def demand_memory(path: str | os.PathLike[str], error: BaseException) -> None:
    """Raise :class:`OutOfMemory` where an error is a lack of memory, which says nothing of the file.

    Examples
    --------
    >>> demand_memory("run.h5", OSError("Can't read data (memory allocation failed for chunk)"))
    Traceback (most recent call last):
    storage.errors.OutOfMemory: run.h5: more memory was demanded than there is; end other programs, or raise the limit
    """
    if isinstance(error, MemoryError) or _NO_MEMORY.search(str(error)):
        demand = "more memory was demanded than there is"
        raise OutOfMemory(path, demand, "end other programs, or raise the limit") from error
