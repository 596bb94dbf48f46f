"""Names and folders of the results that the program writes."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Collection, Sequence
from pathlib import Path, PurePosixPath

from springmass.errors import ProgramError
from springmass.layout import STDIN
from springmass.loading.inputs import kind_of

LONGEST_NAME = 255


def safe_name(text: str, mark: str = "_", *, longest: int = 60) -> str:
    """Return a text as a part of a file's name, with ``mark`` for all but letters and digits of any script, ``+-.``.

    It takes at most ``longest`` bytes, and is empty if nothing of the text is left.

    >>> safe_name("Gyroscope x (rad/s)"), safe_name("位置/m"), safe_name("???")
    ('Gyroscope_x_rad_s', '位置_m', '')
    """
    safe = re.sub(r"(?:[^\w.+-]|_)+", mark, text).strip(f"{mark}.")
    return safe.encode()[:longest].decode(errors="ignore")


def plain_name(name: str, taken: Collection[str] = ()) -> str:
    """Return the name of a foreign file for a folder of ours: no path, no hidden file, none that is taken.

    >>> plain_name("../a b/run 1.txt"), plain_name("run.txt", ["run.txt"]), plain_name("..")
    ('run_1.txt', '2-run.txt', 'recording')
    """
    last = PurePosixPath(name.replace("\\", "/")).name
    stem, dot, suffix = last.rpartition(".")
    safe = safe_name(stem or suffix, longest=100) or "recording"
    named, count = f"{safe}.{safe_name(suffix, longest=20)}".rstrip(".") if stem and dot else safe, 2
    while (free := named if count == 2 else f"{count - 1}-{named}") in taken:
        count += 1
    return free


def results_name(path: Path, *, run: str | None = None, channel: str | None = None) -> str:
    """Return the name of the folder for the report of a recording.

    A text keeps its whole name, because ``bob.txt`` and ``bob.csv`` are two recordings; the run and the channel that
    were chosen follow, because each has its own results.

    >>> results_name(Path("bob.csv"), channel="a b"), results_name(Path("bob.csv"), channel="a_b")
    ('bob.csv.a-b.results', 'bob.csv.a_b.results')
    """
    name = "stdin" if str(path) == STDIN else path.name if kind_of(path) == "recording" else path.stem
    chosen = [_distinct(part) for part in (run, channel) if part is not None]
    return in_a_name(".".join((name, *chosen)), ".results")


def _distinct(text: str) -> str:
    """Return a safe name that no other text has: with hyphens for spaces, and a digest if anything else is not kept."""
    safe = safe_name(text)
    if "-" not in text and safe_name(hyphened := text.replace(" ", "-")) == hyphened:
        return hyphened
    return f"{safe}-{hashlib.sha256(text.encode(errors='backslashreplace')).hexdigest()[:8]}".lstrip("-")


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
            f"{folder}: cannot make the folder for results ({error.strerror})", "name another with -o"
        ) from error
    return folder
