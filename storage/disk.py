"""Check the free disk space before a run starts."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from storage.errors import WriteFailed, one_line

__all__ = ["DiskNearlyFull", "check_disk"]


class DiskNearlyFull(WriteFailed):
    """A disk with too little space for a run, found before the run starts."""


def check_disk(path: str | os.PathLike[str], needed_bytes: int) -> int:
    """Return the free bytes of the disk on which a file will be written.

    Parameters
    ----------
    path : str or PathLike
        The file; its folder must exist.
    needed_bytes : int
        Number of bytes that the run will write.

    Raises
    ------
    DiskNearlyFull
        If less space is free.
    WriteFailed
        If the folder does not exist.
    """
    folder = Path(path).absolute().parent
    try:
        free = shutil.disk_usage(folder).free
    except OSError as error:
        problem = f"its folder cannot be read ({error.strerror or one_line(error)})"
        raise WriteFailed(path, problem, "make the folder first") from error
    if free < needed_bytes:
        problem = f"the run needs {_megabytes(needed_bytes)}, but {_megabytes(free)} are free"
        raise DiskNearlyFull(path, problem, "free disk space, record for a shorter time or use another disk")
    return free


def _megabytes(size: int) -> str:
    return f"{size / 1e6:.1f} MB"
