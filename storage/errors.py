"""The error tree of storage.

::

    StorageError
    |-- NotARun        no file, not HDF5, or HDF5 of another layout           springmass exits with 3
    |-- RunDamaged     a run file that is damaged or was edited               springmass exits with 3
    |-- RunClosed      a run that is used outside its ``with``
    |-- QueryRefused   an invalid search of a catalog, or one that would change it
    |-- NotALog        no file, or no wire log                                springmass exits with 3
    |-- LogGrowing     a log that a recording still writes                    springmass exits with 3
    |-- OutOfMemory    too little memory; the file may be sound               springmass exits with 3
    `-- WriteFailed    a file could not be written; an earlier file of that name is unchanged
        |-- RunExists  a file of that name exists and may not be replaced
        `-- DiskNearlyFull   too little disk space for the run, found before it starts

Every message is one line: ``where: what is wrong, got VALUE; what to do``.
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
    "one_line",
    "raise_if_out_of_memory",
    "reading",
]

HDF5_ERRORS = (OSError, KeyError, ValueError, TypeError, RuntimeError, OverflowError, MemoryError)
"""Errors that h5py raises on a wrong checksum, a missing object, a full disk or a value that HDF5 cannot store."""

_NO_MEMORY = re.compile("memory alloc|alloc[a-z]* memory|out of memory|cannot allocate", re.IGNORECASE)


def one_line(error: BaseException) -> str:
    """Return an error's text on a single line (HDF5 uses several).

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
    """Base class of the errors of storage. The message is one line for the user.

    Parameters
    ----------
    path : str or PathLike
        The file.
    problem : str
        Description of the problem, with the actual value.
    remedy : str
        Advice to the user.
    """

    def __init__(self, path: str | os.PathLike[str], problem: str, remedy: str) -> None:
        self.path, self.problem, self.remedy = os.fspath(path), problem, remedy
        super().__init__(f"{self.path}: {problem}; {remedy}")

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the class and arguments that recreate the error in another process."""
        return type(self), (self.path, self.problem, self.remedy)


class NotARun(StorageError):
    """A path without a run file: a missing file, a text file, an HDF5 file of another program."""


class RunDamaged(StorageError):
    """A run file that changed after it was written: a flipped bit, a missing end, an edited attribute."""


class QueryRefused(StorageError):
    """A search that is invalid, takes too long, names an unknown column, or would do anything but read."""


class RunClosed(StorageError):
    """A run that is read after its ``with`` ended."""


class OutOfMemory(StorageError):
    """A file that needs more memory than is available; the file may be sound."""


class WriteFailed(StorageError):
    """A file that could not be written: a full disk, a missing folder, blocks that do not follow each other."""


class RunExists(WriteFailed):
    """A file of that name exists, and the caller did not allow replacing it."""


def damaged(path: str | os.PathLike[str], what: str, how: str) -> RunDamaged:
    """Return the error for a damaged part of a run file."""
    remedy = "restore a copy of the file, or make it again from the wire log or recording"
    return RunDamaged(path, f"{what} is damaged: {how}", remedy)


@contextlib.contextmanager
def reading(path: str | os.PathLike[str], what: str) -> Iterator[None]:
    """Convert the errors that HDF5 raises on damaged bytes to :class:`RunDamaged`."""
    try:
        yield
    except StorageError:
        raise
    except HDF5_ERRORS as error:
        raise_if_out_of_memory(path, error)
        raise damaged(path, what, one_line(error)) from error


def raise_if_out_of_memory(path: str | os.PathLike[str], error: BaseException) -> None:
    """Raise :class:`OutOfMemory` if an error comes from a lack of memory and not from the file.

    Examples
    --------
    >>> raise_if_out_of_memory("run.h5", OSError("Can't read data (memory allocation failed for chunk)"))
    Traceback (most recent call last):
    storage.errors.OutOfMemory: run.h5: out of memory; close other programs or raise the memory limit
    """
    if isinstance(error, MemoryError) or _NO_MEMORY.search(str(error)):
        raise OutOfMemory(path, "out of memory", "close other programs or raise the memory limit") from error
