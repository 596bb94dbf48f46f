"""Open regular files for reading, without blocking; refuse pipes, sockets, devices and directories."""

from __future__ import annotations

import errno
import os
import stat
from io import BufferedReader, FileIO, TextIOWrapper

_OTHERS = (
    (stat.S_ISDIR, "directory"),
    (stat.S_ISFIFO, "pipe"),
    (stat.S_ISSOCK, "socket"),
    (stat.S_ISCHR, "device"),
    (stat.S_ISBLK, "device"),
)


def open_regular(path: str | os.PathLike[str]) -> FileIO:
    """Open a regular file for unbuffered reading.

    Opening a pipe without a writer blocks forever, and reading a terminal or a device may never end. The kind of
    file is therefore checked before and after opening, and the opening itself does not block. The ``strerror`` of the
    OSError gives the reason in a few words.
    """
    _demand_regular(path, os.stat(path).st_mode)
    return open(path, "rb", buffering=0, opener=_open)


def open_regular_text(path: str | os.PathLike[str], encoding: str, *, newline: str | None = None) -> TextIOWrapper:
    """Open a regular text file for reading, with the checks of :func:`open_regular`."""
    return TextIOWrapper(BufferedReader(open_regular(path)), encoding, newline=newline)


def read_regular(path: str | os.PathLike[str]) -> bytes:
    """Return the content of a regular file; see :func:`open_regular`."""
    with open_regular(path) as file:
        return file.readall() or b""


def _open(path: str, flags: int) -> int:
    descriptor = os.open(path, flags | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0))
    try:
        _demand_regular(path, os.fstat(descriptor).st_mode)
    except OSError:
        os.close(descriptor)
        raise
    return descriptor


def _demand_regular(path: str | os.PathLike[str], mode: int) -> None:
    if not stat.S_ISREG(mode):
        got = next((word for holds, word in _OTHERS if holds(mode)), "something else")
        raise OSError(errno.EINVAL, f"expected a regular file, got a {got}", os.fspath(path))
