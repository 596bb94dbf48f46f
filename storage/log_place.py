"""Where a log lies while it is recorded: under its name, or where somebody moved it to meanwhile.

What is appended reaches the file whatever becomes of its name. So a log that was renamed, with its folder or without,
is found again, and one that was deleted is written anew from the file that is still open.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import shutil
from pathlib import Path

from storage.errors import WriteFailed, one_line

__all__ = ["LogPlace"]

OPEN_FILES = Path("/proc/self/fd")
"""Where Linux tells the present name of an open file."""


class LogPlace:
    """Holds on to a log that has just been made.

    Parameters
    ----------
    path : Path

    Attributes
    ----------
    astray : str
        What became of the log's name, for people; empty while it leads to the log.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.astray = ""
        self._descriptor = -1
        with contextlib.suppress(OSError):  # then nothing is known of it; the log is recorded all the same
            self._descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_CLOEXEC", 0))

    def look(self) -> None:
        """See whether the name still leads to the log."""
        if self._descriptor < 0 or os.name == "nt":  # Windows lets nobody rename or remove an open file
            return
        own = os.fstat(self._descriptor)
        try:
            there = os.stat(self.path)
        except OSError:
            self.astray = "the log was deleted" if own.st_nlink == 0 else "the log or its folder was renamed"
            return
        same = (there.st_dev, there.st_ino) == (own.st_dev, own.st_ino)
        self.astray = "" if same else "another file has taken the log's name"

    def found(self) -> Path:
        """Return where the log is, written anew where it has no name any more.

        Raises
        ------
        WriteFailed
            If it has none and cannot be written anew.
        """
        self.look()
        if not self.astray:
            return self.path
        moved = self._moved_to()
        return self._saved() if moved is None else moved

    def close(self) -> None:
        """Let go of it."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    def _moved_to(self) -> Path | None:
        try:
            place = Path(os.readlink(OPEN_FILES / str(self._descriptor)))
            return place if os.path.samestat(os.stat(place), os.fstat(self._descriptor)) else None
        except OSError:
            return None

    def _saved(self) -> Path:
        for number in itertools.count():
            suffix = f".saved{number}.wire" if number else ".wire"
            place = self.path.with_name(self.path.stem + suffix)
            try:
                with open(place, "xb") as copy, os.fdopen(os.dup(self._descriptor), "rb") as log:
                    log.seek(0)
                    shutil.copyfileobj(log, copy)
                    copy.flush()
                    os.fsync(copy.fileno())
            except FileExistsError:
                continue
            except OSError as error:
                demand = f"{self.astray}, and it cannot be written anew ({one_line(error)})"
                raise WriteFailed(self.path, demand, "nothing of the recording could be kept") from error
            return place
        raise AssertionError("a name is always found")
