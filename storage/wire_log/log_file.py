"""Define the file of a log: the interface between the log's writer and the disk."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from storage.atomic import sync_folder

if sys.platform != "win32":
    import fcntl


class LogFile(Protocol):
    """The interface between the log's writer and the disk; tests replace it with a failing one."""

    def write(self, data: bytes | memoryview) -> int:
        """Append bytes; return how many of them were written, as ``os.write`` does. Raises OSError."""

    def sync(self) -> None:
        """Sync all written bytes to the disk. Raises OSError."""

    def close(self) -> None:
        """Close the file."""


class _NewFile(io.FileIO):
    """A new file that is locked while it is open and has no buffers outside the kernel."""

    # macOS and Windows have no fdatasync; fsync also syncs the metadata.
    _sync: Callable[[int], None] = staticmethod(getattr(os, "fdatasync", os.fsync))

    def __init__(self, path: Path) -> None:
        super().__init__(path, "x", opener=lambda name, flags: os.open(name, flags | os.O_APPEND, 0o666))
        if sys.platform != "win32":
            with contextlib.suppress(OSError):  # a network disk without locks
                fcntl.flock(self.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)

    def sync(self) -> None:
        self._sync(self.fileno())


def open_log_file(path: Path) -> LogFile:
    """Create a new file for appending and sync its name to the disk. Raises OSError."""
    file = _NewFile(path)
    with contextlib.suppress(OSError):  # a disk that cannot sync a folder
        sync_folder(path.parent)
    return file
