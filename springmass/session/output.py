"""The names that a recording will take, looked at before it begins."""

from __future__ import annotations

import os
from pathlib import Path

from springmass.errors import USAGE, ProgramError
from storage.recovery.recover import run_paths

__all__ = ["demand_new"]


def demand_new(path: Path, sensors: int) -> None:
    """Refuse to record over anything, or to a name that cannot be: of the log, and of each sensor's run file.

    Raises
    ------
    ProgramError
        With exit code 2 if the run file or its log exists, a link to nothing among them, or a name is too long.
    """
    longest = _longest_name(path.parent)
    for there in dict.fromkeys((path, path.with_suffix(".wire"), *run_paths(path, range(sensors)))):
        if (size := len(os.fsencode(there.name))) > longest:
            raise ProgramError(
                f"{there}: a name of at most {longest} bytes was demanded, got {size}; choose a shorter one", USAGE
            )
        if there.is_symlink() and not there.exists():
            raise ProgramError(f"{there}: a link to nothing stands there; remove it or choose another name", USAGE)
        if there.exists():
            raise ProgramError(
                f"{there}: exists already, and a recording never replaces one; choose another name", USAGE
            )


def _longest_name(folder: Path) -> int:
    try:
        return os.pathconf(folder, "PC_NAME_MAX")
    except (OSError, AttributeError, ValueError):  # Windows, or a folder that is not there, which is said elsewhere
        return 255
