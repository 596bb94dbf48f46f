"""Keep a log open for reading during the recording, so that it can be read even after a rename or deletion."""

from __future__ import annotations

import os
import weakref
from pathlib import Path
from typing import BinaryIO

from storage.wire_log.scanning import LogContents
from storage.wire_log.window import LogPart

__all__ = ["HeldLog"]


class HeldLog:
    """A read descriptor of a log, which is closed with the last reference to this object.

    It is not for Windows, where an open file cannot be renamed or deleted.

    Parameters
    ----------
    path : Path
        The log, which has just been created.

    Raises
    ------
    OSError
        If the log cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._descriptor = os.open(path, os.O_RDONLY)
        weakref.finalize(self, os.close, self._descriptor)

    def astray(self) -> str:
        """Return a text if the log was deleted, renamed or replaced; empty if its path still leads to it."""
        own = os.fstat(self._descriptor)
        try:
            there = os.stat(self._path)
        except OSError:
            return "the log was deleted" if own.st_nlink == 0 else "the log or its folder was renamed"
        return "" if os.path.samestat(there, own) else "another file has taken the name of the log"

    def contents(self) -> LogContents:
        """Return the current content of the log, which keeps its original path in messages.

        Raises
        ------
        NotALog
            If the log cannot be read.
        """
        return LogContents(self._path, [LogPart.at(self._path, self._opened)])

    def _opened(self) -> BinaryIO:
        # A duplicate descriptor shares the file position, so passes over the log must not overlap.
        file = os.fdopen(os.dup(self._descriptor), "rb")
        file.seek(0)
        return file
