"""Room on the disk, looked at before a run starts."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from storage.errors import WriteFailed, one_line

__all__ = ["DiskNearlyFull", "check_disk"]


class DiskNearlyFull(WriteFailed):
    """A disk with less room than a run will need, found before the run starts."""


def check_disk(path: str | os.PathLike[str], needed_bytes: int) -> int:
    """Return the free bytes of the disk that a file is going to lie on.

    Parameters
    ----------
    path : str or PathLike
        The file; its folder must exist.
    needed_bytes : int
        What the run will write.

    Raises
    ------
    DiskNearlyFull
        If less is free.
    WriteFailed
        If the folder is not there.
    """
    folder = Path(path).absolute().parent
    try:
        free = shutil.disk_usage(folder).free
    except OSError as error:
        demand = f"a folder with {_megabytes(needed_bytes)} of room was demanded, got none"
        raise WriteFailed(path, f"{demand} ({error.strerror or one_line(error)})", "make the folder first") from error
    if free < needed_bytes:
        demand = f"the run needs {_megabytes(needed_bytes)}, but {_megabytes(free)} are free"
        raise DiskNearlyFull(path, demand, "make room, record for a shorter time, or name a file on another disk")
    return free


def _megabytes(size: int) -> str:
    return f"{size / 1e6:.1f} MB"
