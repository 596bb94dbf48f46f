"""The file under a log, as its writer sees it: the seam between the two."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, Protocol

from storage.atomic import sync_folder

if sys.platform != "win32":
    import fcntl

__all__ = ["LogFile", "is_being_written", "open_log_file"]


class LogFile(Protocol):
    """The seam between the writer and the disk; tests put a failing one in its place."""

    def write(self, data: bytes | memoryview) -> int:
        """Append; return how many bytes were taken, as ``os.write`` does. Raises OSError."""
        ...

    def sync(self) -> None:
        """Return when what was written is on the disk. Raises OSError."""
        ...

    def close(self) -> None:
        """Close."""
        ...


class _NewFile(io.FileIO):
    """A file that was not there yet, locked while it is open; nothing is buffered on this side of the kernel."""

    # macOS and Windows have no fdatasync; fsync does more than it.
    _sync: Callable[[int], None] = staticmethod(getattr(os, "fdatasync", os.fsync))

    def __init__(self, path: Path) -> None:
        super().__init__(path, "x", opener=lambda name, flags: os.open(name, flags | os.O_APPEND, 0o666))
        if sys.platform != "win32":
            with contextlib.suppress(OSError):  # a network disk without locks
                fcntl.flock(self.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)

    def sync(self) -> None:
        self._sync(self.fileno())


def open_log_file(path: Path) -> LogFile:
    """Make a file that is not there yet, for appending, its name safe on the disk. Raises OSError."""
    file = _NewFile(path)
    with contextlib.suppress(OSError):  # then the name is as safe as it gets
        sync_folder(path.parent)
    return file


def is_being_written(file: BinaryIO) -> bool:
    """Return whether the writer of a log's file, in this process or another, still holds its lock.

    False on Windows and on a disk without locks, where nobody can know.
    """
    if sys.platform == "win32":
        return False
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        fcntl.flock(file, fcntl.LOCK_UN)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False
