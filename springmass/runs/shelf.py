"""A shelf of recordings, which is a folder or a zip archive: what each file is, and what it leaves open."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from acquisition.errors import AcquisitionError, FormatError, NeedsAnswer, UnknownFormat
from acquisition.recordings.base import read_bytes
from acquisition.recordings.families.archive import members
from acquisition.recordings.identify import inspect, sniff
from acquisition.recordings.questions import Missing
from springmass.errors import ProgramError
from springmass.runs.loading import load
from storage.errors import StorageError

__all__ = ["Entry", "is_shelf", "shelf"]


@dataclass(frozen=True, slots=True)
class Entry:
    """One file on a shelf.

    Parameters
    ----------
    file : str
        Name of the file on the shelf.
    family : str
        Family of the recording; empty if it cannot be read.
    channels : tuple of str
        The channel that is read, or all candidates.
    rate_hz, span_s : float or None
    missing : tuple of str
        Options that the file needs.
    error : str
        Why the file cannot be read; empty if it can.
    recognised : bool
        Whether a family of recordings recognises its content.
    """

    file: str
    family: str
    channels: tuple[str, ...] = ()
    rate_hz: float | None = None
    span_s: float | None = None
    missing: tuple[str, ...] = ()
    error: str = ""
    recognised: bool = True


def is_shelf(path: Path) -> bool:
    """Return whether a path is a folder or a zip archive."""
    if path.is_dir():
        return True
    try:
        return sniff(path) == "zip"
    except FormatError:
        return False


def shelf(path: Path) -> Iterator[Entry]:
    """Yield an entry for each file of a zip archive, or of a folder and its subfolders except hidden files.

    Raises
    ------
    FormatError
        If an archive cannot be unpacked.
    """
    if path.is_dir():
        for file in sorted(each for each in path.rglob("*") if each.is_file()):
            inner = file.relative_to(path)
            if not any(part.startswith(".") for part in inner.parts):
                yield _entry(file, str(inner))
        return
    with tempfile.TemporaryDirectory(prefix="springmass-") as folder:
        for number, (name, data) in enumerate(members(str(path), read_bytes(path))):
            file = Path(folder) / f"{number}" / (PurePosixPath(name).name or "file")
            file.parent.mkdir()
            file.write_bytes(data)
            yield _entry(file, name)


def _entry(path: Path, name: str) -> Entry:
    try:
        try:
            loaded = load(path)
        except NeedsAnswer as unanswered:
            return _unanswered_entry(path, name, unanswered)
    except (AcquisitionError, StorageError, ProgramError) as error:
        text = str(error).removeprefix(str(path)).lstrip(":, ")
        return Entry(name, "", error=text, recognised=not isinstance(error, UnknownFormat))
    t = loaded.samples.t[np.isfinite(loaded.samples.t)]
    span = float(t.max() - t.min()) if t.size else None
    return Entry(name, loaded.format, (loaded.channel,), loaded.info.rate_hz, span)


def _unanswered_entry(path: Path, name: str, unanswered: NeedsAnswer) -> Entry:
    found = inspect(path)
    missing = tuple(each.value.replace("_", "-") for each in unanswered.question.missing)
    surveys = [each for each in found.surveys if each.samples]
    channels = tuple(dict.fromkeys(each.channel for each in surveys))
    timed = bool(surveys) and not {Missing.RATE_HZ, Missing.TIME_UNIT} & {*unanswered.question.missing}
    rate_hz, span_s = (surveys[0].rate_hz, surveys[0].span_s) if timed else (None, None)
    return Entry(name, found.format, channels, rate_hz, span_s, missing)
