"""Choose and check the file names of a recording before it begins."""

import glob
import itertools
import os
from datetime import datetime
from pathlib import Path

from springmass.errors import ProgramError
from springmass.result.output_names import safe_name
from storage.recovery.recover import run_paths


def default_name(what: str, now: datetime, folder: Path = Path()) -> Path:
    """Return a name in a folder with time and subject, and with a number if the name is taken.

    >>> str(default_name("undamped", datetime(2026, 11, 22, 14, 5)))
    '2026-11-22_1405_undamped.h5'
    """
    stem = f"{now:%Y-%m-%d_%H%M}_{safe_name(what, '-') or 'run'}"
    taken = {path.name.removeprefix(stem).split(".")[0] for path in folder.glob(f"{stem}*")}
    number = next(text for text in itertools.chain([""], (f"-{n}" for n in itertools.count(2))) if text not in taken)
    return folder / f"{stem}{number}.h5"


def demand_new(path: Path, sensors: int) -> None:
    """Refuse names for the log and for the run files that are too long or taken, even by a dangling link."""
    longest = _longest_name(path.parent)
    runs = run_paths(path, range(sensors))
    parts = [part for run in runs for part in sorted(run.parent.glob(f"{glob.escape(run.stem)}.part*.h5"))]
    for there in dict.fromkeys((path, path.with_suffix(".wire"), *runs, *parts)):
        if (size := len(os.fsencode(there.name))) > longest:
            why, remedy = f"expected a name of at most {longest} bytes, got {size}", "choose a shorter one"
        elif there.is_symlink() and not there.exists():
            why, remedy = "it is a link to a file that does not exist", "remove it or choose another name"
        elif there.exists():
            why, remedy = "exists already, and a recording never replaces one", "choose another name"
        else:
            continue
        raise ProgramError(f"{there}: {why}", remedy)


def _longest_name(folder: Path) -> int:
    try:
        return os.pathconf(folder, "PC_NAME_MAX")
    except (OSError, AttributeError, ValueError):  # Windows, or a missing folder, which is reported elsewhere
        return 255
