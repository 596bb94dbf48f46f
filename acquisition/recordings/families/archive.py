"""A zip archive with recordings: phyphox's CSV export, a packed folder, Tracker's trz.

Each file inside is read by its own format; if there are several, each is a run and the user chooses one. Pictures,
videos and similar files are skipped and listed. The sheets of a workbook are joined in the same way.
"""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import PurePosixPath

from acquisition.errors import FormatError
from acquisition.recordings.identify import foreign_format, formats
from acquisition.recordings.recording import FormatIssue
from acquisition.recordings.tables.format import ColumnFormat
from acquisition.recordings.tables.table import Table
from acquisition.recordings.tables.text import HEAD_BYTES, ZIP_MAGIC

MOST_UNPACKED_BYTES = 1 << 28
"""Maximum unpacked size of all parts of a file, bytes; one hour of a phone's sensor data takes a tenth of it."""
NOT_INSIDE = ("motion-sensor", "workbook", "zip")  # the first sums velocities only in a file of its own
_MOST_MEMBERS = 2000
_DAMAGE = (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError, OSError, ValueError)
"""Exceptions that zipfile raises for damaged or encrypted files and for unknown kinds of compression."""


def tables_inside(
    path: str, parts: Iterable[tuple[str, bytes]], what: str, but: Sequence[str] = NOT_INSIDE
) -> list[Table]:
    """Return the tables of all parts of a file, given by name and content: each is a run, unless there is only one.

    The parts are read by their formats, but for some. ``what`` is the word for a part.
    """
    families = [each for each in formats() if isinstance(each, ColumnFormat) and each.name not in but]
    recordings: list[tuple[str, Sequence[Table]]] = []
    unread: list[str] = []
    refusal = None
    for name, data in parts:
        family = next((each for each in families if each.recognises(data[:HEAD_BYTES])), None)
        try:
            if family is not None:
                recordings.append((name, family.tables(f"{path}, {what} {name}", data)))
                continue
        except FormatError as error:
            refusal = error
        unread.append(name)
    if not recordings:
        listed = ", ".join(f'"{name}"' for name in unread[:8]) or "none"
        problem = f"expected a {what} with rows of numbers, got {listed}"
        if refusal is not None and len(unread) == 1:
            raise refusal
        raise foreign_format(path, b"") or FormatError(path, problem, "check that the recording was saved in it")
    if any(_is_timed(tables) for _, tables in recordings):  # then no part without times is a recording
        unread += [name for name, tables in recordings if not _is_timed(tables)]
        recordings = [(name, tables) for name, tables in recordings if _is_timed(tables)]
    traps: tuple[FormatIssue, ...] = ()
    if unread:
        listed = ", ".join(f'"{name}"' for name in unread[:8]) + (" and others" if len(unread) > 8 else "")
        traps = (FormatIssue("preamble", f"not a recording: {what} {listed}", len(unread)),)
    if len(recordings) == 1:
        name, tables = recordings[0]
        return [replace(each, title=each.title or name, traps=(*each.traps, *traps)) for each in tables]
    for name, tables in recordings:
        traps += tuple(replace(trap, message=f"{name}: {trap.message}") for trap in tables[0].traps)
    return [
        replace(each, run=f"{name}: {each.run}" if each.run else name, title="", traps=traps)
        for name, tables in recordings
        for each in tables
    ]


def _is_timed(tables: Sequence[Table]) -> bool:
    return any(each.is_timed for each in tables)


def members(path: str, data: bytes) -> Iterator[tuple[str, bytes]]:
    """Yield the name and content of each file in a zip archive, except files that operating systems add."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            listed = list(filter(_is_wanted, archive.infolist()))
            total = sum(each.file_size for each in listed)
            if len(listed) > _MOST_MEMBERS or total > MOST_UNPACKED_BYTES:
                limits = f"at most {_MOST_MEMBERS} files of {MOST_UNPACKED_BYTES} bytes"
                problem = f"expected {limits}, got {len(listed)} of {total} bytes"
                raise FormatError(path, problem, "unpack it, and name a file inside")
            for each in listed:
                with archive.open(each) as file:
                    # zipfile stops at the stated size, and raises an error if the file is longer.
                    yield each.filename, file.read()
    except _DAMAGE as error:
        if isinstance(error, FormatError):
            raise
        reason = " ".join(str(error).split()) or type(error).__name__
        unread = FormatError(path, f"cannot be unpacked ({reason[:200]})", "pack or export it again")
        raise foreign_format(path, b"") or unread from error


def is_one_recording(data: bytes) -> bool:
    """Return whether the files of an archive belong together; phyphox packs its sensors with a file about the phone."""
    return b"meta/device.csv" in data


def _is_wanted(file: zipfile.ZipInfo) -> bool:
    """Return whether a file is none that an operating system adds."""
    if not file.filename:
        raise zipfile.BadZipFile("a file in it has no name")
    hidden = file.filename.startswith("__MACOSX/") or PurePosixPath(file.filename).name[:1] == "."
    return not file.is_dir() and not hidden


def _evidence(head: bytes) -> str:
    others = (
        b"[Content_Types].xml" in head
        or b"xl/" in head
        or b".npy" in head[30:128]
        or b"application/vnd.oasis" in head[:200]
    )
    return "it begins with the bytes of a zip archive" if head.startswith(ZIP_MAGIC) and not others else ""


FORMAT = ColumnFormat(
    "zip",
    "a zip archive of recordings, each a run: phyphox's CSV export",
    _evidence,
    lambda path, data: tables_inside(path, members(path, data), "file"),
)
