"""Files that contain other files or sheets: each part is read by its own format and becomes a run.

In: texts or whole files with their names. Out: their joint content. Parts that no format recognises are listed.
"""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import PurePosixPath

from acquisition.errors import FormatError
from acquisition.recordings.base import HEAD_BYTES
from acquisition.recordings.foreign import foreign_format
from acquisition.recordings.identify import formats
from acquisition.recordings.recording import Trap
from acquisition.recordings.tables.contents import Arrays, Channel, Contents
from acquisition.recordings.tables.sheet import ColumnFormat

__all__ = ["MOST_BYTES", "contents_of_parts", "members"]

MOST_BYTES = 1 << 28
"""Maximum unpacked size of all parts of a file, bytes; one hour of a phone's sensor data takes a tenth of it."""
_MOST_MEMBERS = 2000
_CONTAINERS = ("workbook", "zip")
_DAMAGE = (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError, OSError, ValueError)
"""Exceptions that zipfile raises for damaged or encrypted files and for unknown kinds of compression."""


def contents_of_parts(path: str, parts: Iterable[tuple[str, bytes]], what: str) -> Contents:
    """Return the joint content of the parts of a file: each recording is a run, unless there is only one.

    Parameters
    ----------
    path : str
        For messages.
    parts : iterable of (str, bytes)
        Name and content of each part.
    what : str
        Name of a part in messages, for example "sheet".

    Raises
    ------
    FormatError
        If no part contains a recording.
    """
    families = [each for each in formats() if isinstance(each, ColumnFormat) and each.name not in _CONTAINERS]
    recordings: list[tuple[str, Contents]] = []
    unread: list[str] = []
    for name, data in parts:
        family = next((each for each in families if each.recognises(data[:HEAD_BYTES])), None)
        try:
            if family is not None:
                recordings.append((name, family.contents(f"{path}, {what} {name}", data)))
                continue
        except FormatError:
            pass  # listed below with the other parts that are not recordings
        unread.append(name)
    if not recordings:
        listed = ", ".join(f'"{name}"' for name in unread[:8]) or "none"
        problem = f"expected a {what} with rows of numbers, got {listed}"
        raise foreign_format(path, b"") or FormatError(path, problem, "check that the recording was saved in it")
    if any(_is_timed(contents) for _, contents in recordings):  # then no part without times is a recording
        unread += [name for name, contents in recordings if not _is_timed(contents)]
        recordings = [(name, contents) for name, contents in recordings if _is_timed(contents)]
    traps: tuple[Trap, ...] = ()
    if unread:
        listed = ", ".join(f'"{name}"' for name in unread[:8]) + (" and others" if len(unread) > 8 else "")
        traps = (Trap("preamble", f"not a recording: {what} {listed}", len(unread)),)
    if len(recordings) == 1:
        name, contents = recordings[0]
        return replace(contents, title=contents.title or name, traps=(*contents.traps, *traps))
    channels: list[Channel] = []
    for name, contents in recordings:
        channels.extend(replace(c, run=f"{name}: {c.run}" if c.run else name) for c in contents.channels)
        traps += tuple(replace(trap, message=f"{name}: {trap.message}") for trap in contents.traps)
    return Contents(tuple(channels), traps=traps)


def _is_timed(contents: Contents) -> bool:
    """Return whether any channel has times."""
    return any(
        each.formula is not None
        or (each.source.t is not None if isinstance(each.source, Arrays) else each.time is not None)
        for each in contents.channels
    )


def members(path: str, data: bytes, most_bytes: int = MOST_BYTES, head_bytes: int = -1) -> Iterator[tuple[str, bytes]]:
    """Yield the name and content of each file in a zip archive, except files that operating systems add.

    Parameters
    ----------
    path : str
        For messages.
    data : bytes
        The archive.
    most_bytes : int
        Maximum unpacked size of all files together.
    head_bytes : int, optional
        Maximum number of bytes to unpack from each file; all by default.

    Raises
    ------
    FormatError
        If the archive is damaged or encrypted, has too many files, or is too large when unpacked.
    """
    remedy = "unpack it, and name a file inside"
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            listed = _wanted(archive.infolist())
            if len(listed) > _MOST_MEMBERS:
                problem = f"expected an archive of at most {_MOST_MEMBERS} files, got {len(listed)}"
                raise FormatError(path, problem, remedy)
            total = sum(each.file_size for each in listed)
            if total > most_bytes:
                problem = f"expected at most {most_bytes} bytes unpacked, got {total}"
                raise FormatError(path, problem, remedy)
            for each in listed:
                with archive.open(each) as file:
                    # zipfile stops at the stated size, and raises an error if the file is longer.
                    yield each.filename, file.read(head_bytes)
    except _DAMAGE as error:
        if isinstance(error, FormatError):
            raise
        reason = " ".join(str(error).split()) or type(error).__name__
        unread = FormatError(path, f"cannot be unpacked ({reason[:200]})", "pack or export it again")
        raise foreign_format(path, b"") or unread from error


def _wanted(listed: Sequence[zipfile.ZipInfo]) -> list[zipfile.ZipInfo]:
    if not all(each.filename for each in listed):
        raise zipfile.BadZipFile("a file in it has no name")
    return [
        each
        for each in listed
        if not each.is_dir()
        and not each.filename.startswith("__MACOSX/")
        and PurePosixPath(each.filename).name[:1] != "."
    ]
