"""A log that is kept open for reading during the recording, so that it can be read even after a rename or deletion."""

from __future__ import annotations

import os
import weakref
from pathlib import Path
from typing import BinaryIO

from storage.wire_log.scanning import LogContents
from storage.wire_log.window import LogPart

__all__ = ["HeldLog"]


class HeldLog:
    """One read descriptor of a log, which is closed with the last reference to it.

    Not for Windows, where an open file cannot be renamed or deleted.

    Parameters
    ----------
    path : Path
        The log, just after it was made.

    Raises
    ------
    OSError
        If it cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._descriptor = os.open(path, os.O_RDONLY)
        weakref.finalize(self, os.close, self._descriptor)

    def astray(self) -> str:
        """Return in words whether the log was deleted, renamed or replaced; empty if its name still leads to it."""
        own = os.fstat(self._descriptor)
        try:
            there = os.stat(self._path)
        except OSError:
            return "the log was deleted" if own.st_nlink == 0 else "the log or its folder was renamed"
        return "" if os.path.samestat(there, own) else "another file has taken the name of the log"

    def contents(self) -> LogContents:
        """Return the current content of the log, under its first name.

        Raises
        ------
        NotALog
            If it cannot be read.
        """
        return LogContents(self._path, [LogPart.at(self._path, self._opened)])

    def _opened(self) -> BinaryIO:
        # A duplicate descriptor shares its position, so passes over the log must not overlap.
        file = os.fdopen(os.dup(self._descriptor), "rb")
        file.seek(0)
        return file
