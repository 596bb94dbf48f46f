"""A log's bytes, a stretch of them in memory at a time, however long the log and however many files it lies in."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import BinaryIO

from acquisition.regular_file import open_regular
from storage.errors import StorageError, one_line
from storage.wire_log.records import HEAD_BYTES, MAGIC, MAX_PAYLOAD, Unframed, unframe

__all__ = ["LONGEST", "LogPart", "NotALog", "Taken", "Window"]

LONGEST = HEAD_BYTES + MAX_PAYLOAD
"""Bytes of the longest record."""
STRETCH = 1 << 20
"""So many bytes are read at a time."""

Taken = Callable[[int, bytes], object]
"""What is given the bytes of a log as they are read, with the number of the part from 0."""


class NotALog(StorageError):
    """A path that holds no wire log, or one of which nothing can be read."""


@dataclass(frozen=True, slots=True)
class LogPart:
    """A file of a log.

    Parameters
    ----------
    path : Path
    size : int
        Bytes that it had when it was looked at. What came later is not read, so that every pass reads the same.
    open : callable
        Opens it for reading, at its beginning.
    stat : os.stat_result, optional
        What identifies the file; None for bytes in memory.
    """

    path: Path
    size: int
    open: Callable[[], BinaryIO]
    stat: os.stat_result | None = None

    @classmethod
    def at(cls, path: Path, opened: Callable[[], BinaryIO] | None = None) -> LogPart:
        """Return a file as it stands.

        Parameters
        ----------
        path : Path
        opened : callable, optional
            Opens it where its name may not lead to it; left out, it is opened by its name.

        Raises
        ------
        NotALog
            If there is none, or none that can be read.
        """
        opened = opened or partial(open_regular, path)
        try:
            with opened() as file:
                stat = os.fstat(file.fileno())
        except OSError as error:
            raise _unreadable(path, error) from error
        return cls(path, stat.st_size, opened, stat)

    def in_place(self) -> bool:
        """Return whether its name leads to it, and it has not grown since. Raises OSError."""
        there = os.stat(self.path)
        return self.stat is not None and os.path.samestat(there, self.stat) and there.st_size == self.size

    def sha256(self) -> str:
        """Return the SHA-256 of its bytes as they are on the disk now; those that came later do not count.

        Raises
        ------
        NotALog
            If it cannot be read any more.
        """
        digest, left = hashlib.sha256(), self.size
        try:
            with self.open() as file:
                while data := file.read(min(STRETCH, left)):
                    digest.update(data)
                    left -= len(data)
        except OSError as error:
            raise _unreadable(self.path, error) from error
        return digest.hexdigest()


class Window:
    """The part of a log that is being looked at: bytes ``data`` of it, from byte ``base`` on.

    Parameters
    ----------
    parts : sequence of LogPart
    taken : callable
        Is given every byte once, in order.
    live : bool
        Whether the log is still being written: more may come where the last file ends.

    Attributes
    ----------
    whole : bool
        Whether the log ended with the bytes in memory when they were read.
    """

    def __init__(self, parts: Sequence[LogPart], taken: Taken = lambda *_: None, *, live: bool = False) -> None:
        self._parts, self._taken, self.live = tuple(parts), taken, live
        self._number = 0
        self._file: BinaryIO | None = None
        self._left = 0
        self.data = b""
        self.base = self.at = 0
        self.whole = False

    def close(self) -> None:
        """Close the file that is open; again does no harm."""
        if self._file is not None:
            self._file.close()
            self._file = None

    @property
    def offset(self) -> int:
        """Byte of the log that :attr:`at` stands at."""
        return self.base + self.at

    def fill(self) -> None:
        """Forget what lies before :attr:`at`, and read on until the longest record would be whole, or to the end."""
        pieces = [self.data[self.at :]]
        self.base, self.at = self.base + self.at, 0
        length, self.whole = len(pieces[0]), False
        while length < LONGEST and not self.whole:
            piece = self._read()
            self.whole = not piece
            pieces.append(piece)
            length += len(piece)
        self.data = b"".join(pieces)

    def _read(self) -> bytes:
        """Return the next stretch of the log; nothing at the end of its last file."""
        while self._number < len(self._parts):
            part, last = self._parts[self._number], self._number == len(self._parts) - 1
            try:
                if self._file is None:
                    self._file, self._left = part.open(), part.size
                wanted = STRETCH if self.live and last else min(STRETCH, self._left)
                data = self._file.read(wanted)
            except OSError as error:
                raise _unreadable(part.path, error) from error
            if data:
                self._left -= len(data)
                self._taken(self._number, data)
                return data
            if self.live and last:
                return b""
            self.close()
            self._number += 1
        return b""

    def record(self, log: int | None) -> Unframed | None:
        """Return the record that begins at :attr:`at`, None where no whole and sound one does."""
        if len(self.data) - self.at < LONGEST and not self.whole:
            self.fill()
        return unframe(self.data, self.at, log)

    def seek(self, log: int | None) -> bool:
        """Go to the next sound record behind :attr:`at`, or to the end; return whether there is one.

        Where none comes in a live log it stays: the record that begins here may still be written to its end.
        """
        at = self.at + 1
        while True:
            at = self.data.find(MAGIC, at)
            if not self.whole and (at < 0 or len(self.data) - at < LONGEST):
                # The last byte may be the first of a magic.
                self.at = len(self.data) - 1 if at < 0 else at
                self.fill()
                at = 0
                continue
            if at < 0:
                self.at = self.at if self.live else len(self.data)
                return False
            if unframe(self.data, at, log) is not None:
                self.at = at
                return True
            at += 1


def _unreadable(path: Path, error: OSError) -> NotALog:
    demand = f"a wire log was demanded, got no file that can be read ({error.strerror or one_line(error)})"
    return NotALog(path, demand, "name a file that springmass record left behind")
