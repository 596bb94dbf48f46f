"""Check the free disk space before a run starts."""

from __future__ import annotations

import shutil
from pathlib import Path

from storage.errors import DiskNearlyFull, WriteFailed, one_line


def check_disk(path: Path, needed_bytes: int) -> None:
    """Raise DiskNearlyFull if the disk of a file has less space, and WriteFailed if the file's folder is missing."""
    try:
        free = shutil.disk_usage(path.absolute().parent).free
    except OSError as error:
        problem = f"its folder cannot be read ({error.strerror or one_line(error)})"
        raise WriteFailed(path, problem, "make the folder first") from error
    if free < needed_bytes:
        problem = f"the run needs {needed_bytes / 1e6:.1f} MB, but {free / 1e6:.1f} MB are free"
        raise DiskNearlyFull(path, problem, "free disk space, record for a shorter time or use another disk")
