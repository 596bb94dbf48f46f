"""What a family of recordings must offer, and how a file's bytes are fetched for it."""

from __future__ import annotations

import mmap
import os
import sys
from io import FileIO
from pathlib import Path
from typing import Protocol, runtime_checkable

from acquisition.errors import FormatError
from acquisition.recordings.inspection import Survey
from acquisition.recordings.recording import Recording
from acquisition.recordings.tables.text import is_text
from acquisition.regular_file import open_regular

__all__ = ["HEAD_BYTES", "Format", "PairFormat", "SurveyFormat", "dialect_folder", "read_bytes", "read_head"]

HEAD_BYTES = 8192
"""How much of a file a format sees to recognise it."""

_LONGEST_LINE = 1 << 20
_MARKUP = b"\xef\xbb\xbf \t\r\n"  # XML may well stand in one line


class Format(Protocol):
    """A family of recordings, told by content and never by suffix."""

    @property
    def name(self) -> str:
        """As the registry and the command line call it."""
        ...

    @property
    def title(self) -> str:
        """One line for people."""
        ...

    def recognises(self, head: bytes) -> bool:
        """Tell from the first :data:`HEAD_BYTES` whether the file is of this family; cheap, never raises."""
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
            For messages and the recording's name; it is not opened.
        data : bytes
            The file's content.
        channel : str, optional
            Which quantity or column to take.
        rate_hz : float, optional
            The rate where the file does not say it, Hz. It is an error where the file contradicts it.
        unit : str, optional
            The channel's unit where the file does not say it.
        run : str, optional
            Which run, where the file holds several. This and the next two are passed only where they were given.
        time, time_unit : str, optional
            Which column is the time, and in which unit, where the file does not say it.

        Raises
        ------
        FormatError
            With one line for the user, whatever is wrong with the content.
        """
        ...


@runtime_checkable
class SurveyFormat(Protocol):
    """A family that says why a file is one of its own, and what the file holds before anything is chosen."""

    def evidence(self, head: bytes) -> str:
        """Say in a few words why the head of a file is of this family; empty where it is not."""
        ...

    def survey(self, path: str, data: bytes) -> tuple[Survey, ...]:
        """Tell of every channel what the file says by itself."""
        ...


class PairFormat(Format, Protocol):
    """A family that keeps position and velocity in files of their own."""

    def read_pair(
        self, position: tuple[str, bytes], velocity: tuple[str, bytes], *, rate_hz: float | None = None
    ) -> Recording:
        """Read two files, each a path and its content, and join them by time."""
        ...


def dialect_folder() -> Path:
    """Return where a user's dialects are: under ``XDG_CONFIG_HOME``, or where the system keeps settings."""
    told = os.environ.get("XDG_CONFIG_HOME") or (os.environ.get("APPDATA") if sys.platform == "win32" else None)
    usual = "~/Library/Application Support" if sys.platform == "darwin" else "~/.config"
    # For every file that is read: pathlib's own ways take five times as long.
    return Path(os.path.join(told or os.path.expanduser(usual), "springmass", "dialects"))


def read_head(path: str | os.PathLike[str]) -> bytes:
    """Return the first :data:`HEAD_BYTES` of a file.

    Raises
    ------
    FormatError
        If it is absent, empty, unreadable or no regular file.
    """
    return _read(path, HEAD_BYTES)


def read_bytes(path: str | os.PathLike[str]) -> bytes:
    """Return a file's content; of a text give up at the first MiB that holds no line end.

    Raises
    ------
    FormatError
        If it is absent, empty, unreadable, no regular file, or a text with a line of more than 1 MiB.
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
    except ValueError as error:  # a NUL in the name
        raise FormatError(repr(name), f"is no file name ({error})", "check its name") from error


def _demand_lines(name: str, file: FileIO) -> None:
    """Give up at the first MiB that holds no line end, before a file of any size is read into memory."""
    with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as text:
        for start in range(0, len(text) - _LONGEST_LINE + 1, _LONGEST_LINE):
            stop = start + _LONGEST_LINE
            if text.find(b"\n", start, stop) < 0 and text.find(b"\r", start, stop) < 0:
                before = text[:start]
                line = 1 + (before.count(b"\n") or before.count(b"\r"))
                demand = "expected lines of text, got a line of more than 1 MiB"
                raise FormatError(name, demand, "this is no text recording; export it again", line=line)
