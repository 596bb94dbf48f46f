"""A log held open for reading while it is recorded, so that it can be read whatever becomes of its name."""

from __future__ import annotations

import os
import weakref
from pathlib import Path
from typing import BinaryIO

from storage.wire_log.scanning import LogContents
from storage.wire_log.window import LogPart

__all__ = ["HeldLog"]


class HeldLog:
    """One read descriptor of a log, closed when nobody refers to it any more.

    Not for Windows, which lets nobody rename or delete an open file.

    Parameters
    ----------
    path : Path
        The log, which has just been made.

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
        """Return what became of the log's name, for people; empty while it leads to the log."""
        own = os.fstat(self._descriptor)
        try:
            there = os.stat(self._path)
        except OSError:
            return "the log was deleted" if own.st_nlink == 0 else "the log or its folder was renamed"
        return "" if os.path.samestat(there, own) else "another file has taken the name of the log"

    def contents(self) -> LogContents:
        """Return what the log holds by now, under the name that it was begun with.

        Raises
        ------
        NotALog
            If it cannot be read.
        """
        return LogContents(self._path, [LogPart.at(self._path, self._opened)])

    def _opened(self) -> BinaryIO:
        # A copy of the descriptor shares its position, so one pass over the log ends before the next begins.
        file = os.fdopen(os.dup(self._descriptor), "rb")
        file.seek(0)
        return file
