"""Locks of open files and folders, in one place because Windows and some disks have none."""

from __future__ import annotations

from typing import IO

_HAS_LOCKS = True
try:
    import fcntl
except ImportError:  # on Windows
    _HAS_LOCKS = False


def lock(file: IO[bytes] | int, *, wait: bool = False) -> bool:
    """Lock an open file for this descriptor alone; return False where there are no locks.

    Raises BlockingIOError if another descriptor holds the lock and this one does not ``wait`` for it.
    """
    if not _HAS_LOCKS:
        return False
    try:
        fcntl.flock(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        raise
    except OSError:  # a network or FUSE file system without locks
        return False
    return True


def is_locked(file: IO[bytes]) -> bool:
    """Return whether another descriptor holds the lock of an open file; False where that is unknown."""
    if not _HAS_LOCKS:
        return False
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        fcntl.flock(file, fcntl.LOCK_UN)
    except OSError as error:
        return isinstance(error, BlockingIOError)
    return False
