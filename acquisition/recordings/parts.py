"""Files that hold other files or sheets: each part is read as what it is by itself, and is a run of the whole.

In: texts or whole files with their names. Out: what they hold together. Parts that no family knows are named.
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
from acquisition.recordings.foreign import named
from acquisition.recordings.identify import formats
from acquisition.recordings.recording import Trap
from acquisition.recordings.tables.contents import Arrays, Channel, Contents
from acquisition.recordings.tables.sheet import ColumnFormat

__all__ = ["MOST_BYTES", "contents_of_parts", "members"]

MOST_BYTES = 1 << 28
"""As much as all parts of a file may unpack to: an hour of a phone's sensors takes a tenth."""
_MOST_MEMBERS = 2000
_CONTAINERS = ("workbook", "zip")
_DAMAGE = (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError, OSError, ValueError)
"""What zipfile raises for damage, for encryption and for ways of packing that it does not know."""


def contents_of_parts(path: str, parts: Iterable[tuple[str, bytes]], what: str) -> Contents:
    """Return what the parts of a file hold: the one recording among them, or each as a run.

    Parameters
    ----------
    path : str
        For messages.
    parts : iterable of (str, bytes)
        Name and content of each.
    what : str
        What a part is called, "sheet" say.

    Raises
    ------
    FormatError
        If no part holds a recording.
    """
    families = [each for each in formats() if isinstance(each, ColumnFormat) and each.name not in _CONTAINERS]
    held: list[tuple[str, Contents]] = []
    others: list[str] = []
    for name, data in parts:
        family = next((each for each in families if each.recognises(data[:HEAD_BYTES])), None)
        try:
            if family is not None:
                held.append((name, family.contents(f"{path}, {what} {name}", data)))
                continue
        except FormatError:
            pass  # a part of its own name below: it is told with all others that are no recording
        others.append(name)
    if not held:
        listed = ", ".join(f'"{name}"' for name in others[:8]) or "none"
        demand = f"expected a {what} with rows of numbers, got {listed}"
        raise named(path, b"") or FormatError(path, demand, "check that the recording was saved in it")
    if any(_is_timed(contents) for _, contents in held):  # what has no times beside it is no recording
        others += [name for name, contents in held if not _is_timed(contents)]
        held = [(name, contents) for name, contents in held if _is_timed(contents)]
    traps: tuple[Trap, ...] = ()
    if others:
        listed = ", ".join(f'"{name}"' for name in others[:8]) + (" and others" if len(others) > 8 else "")
        traps = (Trap("preamble", f"no recording: {what} {listed}", len(others)),)
    if len(held) == 1:
        name, contents = held[0]
        return replace(contents, title=contents.title or name, traps=(*contents.traps, *traps))
    channels: list[Channel] = []
    for name, contents in held:
        channels.extend(replace(c, run=f"{name}: {c.run}" if c.run else name) for c in contents.channels)
        traps += tuple(replace(trap, message=f"{name}: {trap.message}") for trap in contents.traps)
    return Contents(tuple(channels), traps=traps)


def _is_timed(contents: Contents) -> bool:
    """Tell whether any channel has times."""
    return any(
        each.formula is not None
        or (each.source.t is not None if isinstance(each.source, Arrays) else each.time is not None)
        for each in contents.channels
    )


def members(path: str, data: bytes, most_bytes: int = MOST_BYTES) -> Iterator[tuple[str, bytes]]:
    """Yield name and content of every file in a zip archive, in its order; what an operating system adds is left out.

    Raises
    ------
    FormatError
        If it is damaged or encrypted, or unpacks to more than it may.
    """
    remedy = "unpack it, and name a file inside"
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            listed = _wanted(archive.infolist())
            if len(listed) > _MOST_MEMBERS:
                demand = f"expected an archive of at most {_MOST_MEMBERS} files, got {len(listed)}"
                raise FormatError(path, demand, remedy)
            total = sum(each.file_size for each in listed)
            if total > most_bytes:
                demand = f"expected at most {most_bytes} bytes unpacked, got {total}"
                raise FormatError(path, demand, remedy)
            for each in listed:
                with archive.open(each) as file:
                    # zipfile stops at the size that the archive states, and says so where there is more.
                    yield each.filename, file.read()
    except _DAMAGE as error:
        if isinstance(error, FormatError):
            raise
        reason = " ".join(str(error).split()) or type(error).__name__
        unread = FormatError(path, f"cannot be unpacked ({reason[:200]})", "pack or export it again")
        raise named(path, b"") or unread from error


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
