"""The interface of a family of recordings, and the reading of a file's bytes."""

from __future__ import annotations

import mmap
import os
from io import FileIO
from pathlib import Path
from typing import Protocol, runtime_checkable

from platformdirs import user_config_path

from acquisition.errors import FormatError
from acquisition.recordings.inspection import Survey
from acquisition.recordings.recording import Recording
from acquisition.recordings.tables.text import is_text
from acquisition.regular_file import open_regular

__all__ = ["HEAD_BYTES", "Format", "PairFormat", "SurveyFormat", "dialect_folder", "read_bytes", "read_head"]

HEAD_BYTES = 8192
"""Number of bytes at the start of a file from which a format recognises it."""

_LONGEST_LINE = 1 << 20
_MARKUP = b"\xef\xbb\xbf \t\r\n"  # bytes that may precede XML, which may be a single long line


class Format(Protocol):
    """A family of recordings. Files are identified by content, not by suffix."""

    @property
    def name(self) -> str:
        """Name in the registry and on the command line."""
        ...

    @property
    def title(self) -> str:
        """One line for the user."""
        ...

    def recognises(self, head: bytes) -> bool:
        """Return whether the first :data:`HEAD_BYTES` of a file show that it belongs to this family.

        This must be fast and never raise.
        """
        ...

    def read(
        self,
        path: str,
        data: bytes,
        *,
        channel: str | None = None,
        rate_hz: float | None = None,
        unit: str | None = None,
        run: str | None = None,
        time: str | None = None,
        time_unit: str | None = None,
    ) -> Recording:
        """Read one channel of one run of a file.

        Parameters
        ----------
        path : str
            Used in messages and as the recording's name; it is not opened.
        data : bytes
            The content of the file.
        channel : str, optional
            The quantity or column to read.
        rate_hz : float, optional
            The rate if the file does not state it, Hz. It is an error if the file contradicts it.
        unit : str, optional
            The unit of the channel if the file does not state it.
        run : str, optional
            The run to read if the file contains several. ``run``, ``time`` and ``time_unit`` are passed only if they
            are given.
        time, time_unit : str, optional
            The column that contains the times, and their unit, if the file does not state them.

        Raises
        ------
        FormatError
            If the content is faulty; the message is one line for the user.
        """
        ...


@runtime_checkable
class SurveyFormat(Protocol):
    """A family that states why it recognises a file and lists the channels of the file."""

    def evidence(self, head: bytes) -> str:
        """Return a few words on why a file belongs to this family, or an empty text if it does not."""
        ...

    def survey(self, path: str, data: bytes) -> tuple[Survey, ...]:
        """Return the description of every channel, as far as the file states it."""
        ...


class PairFormat(Format, Protocol):
    """A family that stores position and velocity in separate files."""

    def read_pair(
        self, position: tuple[str, bytes], velocity: tuple[str, bytes], *, rate_hz: float | None = None
    ) -> Recording:
        """Read two files, each given as its path and content, and join them by time."""
        ...


def dialect_folder() -> Path:
    """Return the folder of a user's dialects inside the system's folder for settings.

    Version 0.1 used ``XDG_CONFIG_HOME`` on every system; a folder that it created is still used.
    """
    if (base := os.environ.get("XDG_CONFIG_HOME")) and (earlier := Path(base, "springmass", "dialects")).is_dir():
        return earlier
    return user_config_path("springmass", appauthor=False, roaming=True) / "dialects"


def read_head(path: str | os.PathLike[str]) -> bytes:
    """Return the first :data:`HEAD_BYTES` of a file.

    Raises
    ------
    FormatError
        If the file is absent, empty, unreadable or not a regular file.
    """
    return _read(path, HEAD_BYTES)


def read_bytes(path: str | os.PathLike[str]) -> bytes:
    """Return the content of a file; refuse a text with a very long line before reading it into memory.

    Raises
    ------
    FormatError
        If the file is absent, empty, unreadable or not a regular file, or if it is text other than XML that has a whole
        1 MiB block without a line end.
    """
    return _read(path, None)


def _read(path: str | os.PathLike[str], limit: int | None) -> bytes:
    name = os.fspath(path)
    try:
        with open_regular(name) as file:
            head = file.read(HEAD_BYTES)
            if not head:
                raise FormatError(name, "expected a recording, got an empty file", "check that the export ended")
            if limit is not None:
                return head[:limit]
            by_lines = is_text(head) and not head.lstrip(_MARKUP).startswith(b"<")
            if by_lines:
                _demand_lines(name, file)
            file.seek(0)
            return file.read()
    except OSError as error:
        raise FormatError(
            name, f"cannot be opened ({error.strerror or error})", "check its name and permissions"
        ) from error
    except ValueError as error:  # the name contains a NUL character
        raise FormatError(repr(name), f"not a valid file name ({error})", "check the name") from error


def _demand_lines(name: str, file: FileIO) -> None:
    """Raise an error if any 1 MiB block of the file has no line end, before the file is read into memory."""
    with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as text:
        for start in range(0, len(text) - _LONGEST_LINE + 1, _LONGEST_LINE):
            stop = start + _LONGEST_LINE
            if text.find(b"\n", start, stop) < 0 and text.find(b"\r", start, stop) < 0:
                before = text[:start]
                line = 1 + (before.count(b"\n") or before.count(b"\r"))
                problem = "expected lines of text, got a line of more than 1 MiB"
                raise FormatError(name, problem, "export the recording as text again", line=line)
