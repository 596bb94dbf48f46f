"""Names and folders of the results that the program writes."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Sequence
from pathlib import Path

from springmass.errors import ProgramError

LONGEST_NAME = 255


def safe_name(text: str) -> str:
    """Return a text as a part of a file's name: at most 60 letters, digits and signs; empty if it has none."""
    return re.sub(r"[^A-Za-z0-9.+-]+", "_", text).strip("._")[:60]


def distinct_names(paths: Sequence[str]) -> list[str]:
    """Return a name for each input: its file name without the suffix, with repeated names numbered."""
    return numbered([Path(path).stem for path in paths])


def numbered(stems: Sequence[str]) -> list[str]:
    """Return the names in order, with repeated names numbered."""
    counts: dict[str, int] = {}
    names: dict[str, None] = {}
    for stem in stems:
        count = counts.get(stem, 0) + 1
        while (name := stem if count == 1 else f"{stem}-{count}") in names:
            count += 1
        counts[stem] = count
        names[name] = None
    return list(names)


def in_a_name(name: str, suffix: str) -> str:
    """Return a name with a suffix added, with the name cut if both exceed the 255 bytes that a file name may have."""
    whole = os.fsencode(name)
    if len(whole) + len(suffix) <= LONGEST_NAME:
        return name + suffix
    digest = hashlib.sha256(whole).hexdigest()[:8]  # keeps names distinct that are identical up to the cut
    return f"{whole[: LONGEST_NAME - len(suffix) - 9].decode(errors='ignore')}-{digest}{suffix}"


def make_folder(path: str | Path) -> Path:
    """Return a folder for results, created if it does not exist."""
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ProgramError(
            f"{folder}: cannot make the folder for results ({error.strerror}); name another with -o"
        ) from error
    return folder
