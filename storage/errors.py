"""The errors of storage. Every message is one line: ``where: what is wrong, got VALUE; what to do``."""

from __future__ import annotations

import os

from failure import Error


def one_line(error: BaseException) -> str:
    """Return an error's text on a single line (HDF5 uses several).

    >>> one_line(OSError("no space\\n  left"))
    'no space left'
    >>> one_line(MemoryError())
    'MemoryError'
    """
    # A KeyError shows its text in quotes.
    text = error.args[0] if isinstance(error, KeyError) and error.args else error
    return " ".join(str(text).split()) or type(error).__name__


class StorageError(Error):
    """Base class of the errors of storage: a file, what is wrong with it, and advice to the user."""

    separator = ": "

    def __init__(self, path: str | os.PathLike[str], problem: str, remedy: str) -> None:
        self.path = os.fspath(path)
        super().__init__(problem, remedy, where=f"{self.path}{self.separator}")


class NotARun(StorageError):
    """A path without a run file: a missing file, a text file, an HDF5 file of another program."""


class RunDamaged(StorageError):
    """A run file that changed after it was written: a flipped bit, a missing end, a changed value."""


class RunOpen(StorageError):
    """A run file that another program has open for writing; the file is whole."""

    separator = " "


class RunClosed(StorageError):
    """A run that is read after its ``with`` ended."""


class NotALog(StorageError):
    """A path without a wire log, or with an unreadable one."""


class LogGrowing(StorageError):
    """A log that a recording still writes: a run file made now would be incomplete and take the recording's place."""


class OutOfMemory(StorageError):
    """A file that needs more memory than is available; the file may be sound."""


class WriteFailed(StorageError):
    """A file that could not be written: a full disk, a missing folder, blocks that do not follow each other."""


class RunExists(WriteFailed):
    """A file of that name exists, and the caller did not allow replacing it."""


class DiskNearlyFull(WriteFailed):
    """A disk with too little space for a run, found before the run starts."""
