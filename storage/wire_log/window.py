"""Keep a window of a log's bytes in memory, for logs of any length and in several files."""

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

__all__ = ["LONGEST_RECORD", "LogPart", "NotALog", "TakeBytes", "Window"]

LONGEST_RECORD = HEAD_BYTES + MAX_PAYLOAD
"""Maximum size of a record, bytes."""
STRETCH = 1 << 20
"""Number of bytes that are read at a time."""

TakeBytes = Callable[[int, bytes], object]
"""Called with the number of the part, counted from 0, and the bytes of the log as they are read."""


class NotALog(StorageError):
    """A path without a wire log, or with an unreadable one."""


@dataclass(frozen=True, slots=True)
class LogPart:
    """A file of a log.

    Parameters
    ----------
    path : Path
    size : int
        Size of the file at the time of the check, bytes. Later bytes are not read, so that every pass reads the same
        bytes.
    open : callable
        Opens the file for reading at its beginning.
    stat : os.stat_result, optional
        Identifies the file; None for bytes in memory.
    """

    path: Path
    size: int
    open: Callable[[], BinaryIO]
    stat: os.stat_result | None = None

    @classmethod
    def at(cls, path: Path, opened: Callable[[], BinaryIO] | None = None) -> LogPart:
        """Return the part for a file, with its current size.

        Parameters
        ----------
        path : Path
        opened : callable, optional
            Opens the file if its path may no longer lead to it; by default it is opened by its path.

        Raises
        ------
        NotALog
            If the file does not exist or cannot be read.
        """
        opened = opened or partial(open_regular, path)
        try:
            with opened() as file:
                stat = os.fstat(file.fileno())
        except OSError as error:
            raise _unreadable(path, error) from error
        return cls(path, stat.st_size, opened, stat)

    def in_place(self) -> bool:
        """Return whether the path still leads to the same file with the same size. Raises OSError."""
        there = os.stat(self.path)
        return self.stat is not None and os.path.samestat(there, self.stat) and there.st_size == self.size

    def sha256(self) -> str:
        """Return the SHA-256 of the file's first ``size`` bytes that are on the disk now.

        Raises
        ------
        NotALog
            If the file can no longer be read.
        """
        digest, remaining = hashlib.sha256(), self.size
        try:
            with self.open() as file:
                while data := file.read(min(STRETCH, remaining)):
                    digest.update(data)
                    remaining -= len(data)
        except OSError as error:
            raise _unreadable(self.path, error) from error
        return digest.hexdigest()


class Window:
    """The part of a log in memory: the bytes ``data``, which begin at byte ``base`` of the log.

    Parameters
    ----------
    parts : sequence of LogPart
    take_bytes : callable
        Called with every byte once, in order.
    live : bool
        Whether the log is still being written, so that its last file may grow.

    Attributes
    ----------
    whole : bool
        Whether the bytes in memory reached the end of the log when they were read.
    """

    def __init__(
        self, parts: Sequence[LogPart], take_bytes: TakeBytes = lambda *_: None, *, live: bool = False
    ) -> None:
        self._parts, self._take_bytes, self.live = tuple(parts), take_bytes, live
        self._number = 0
        self._file: BinaryIO | None = None
        self._remaining = 0
        self.data = b""
        self.base = self.at = 0
        self.whole = False

    def close(self) -> None:
        """Close the open file. Further calls do nothing."""
        if self._file is not None:
            self._file.close()
            self._file = None

    @property
    def offset(self) -> int:
        """Position of :attr:`at` in the log, bytes."""
        return self.base + self.at

    def fill(self) -> None:
        """Drop the bytes before :attr:`at`, and read until the longest record would fit, or to the end of the log."""
        pieces = [self.data[self.at :]]
        self.base, self.at = self.base + self.at, 0
        length, self.whole = len(pieces[0]), False
        while length < LONGEST_RECORD and not self.whole:
            piece = self._read()
            self.whole = not piece
            pieces.append(piece)
            length += len(piece)
        self.data = b"".join(pieces)

    def _read(self) -> bytes:
        """Return the next bytes of the log; empty at the end of its last file."""
        while self._number < len(self._parts):
            part, last = self._parts[self._number], self._number == len(self._parts) - 1
            try:
                if self._file is None:
                    self._file, self._remaining = part.open(), part.size
                wanted = STRETCH if self.live and last else min(STRETCH, self._remaining)
                data = self._file.read(wanted)
            except OSError as error:
                raise _unreadable(part.path, error) from error
            if data:
                self._remaining -= len(data)
                self._take_bytes(self._number, data)
                return data
            if self.live and last:
                return b""
            self.close()
            self._number += 1
        return b""

    def record(self, log: int | None) -> Unframed | None:
        """Return the record that begins at :attr:`at`; None if there is no complete and valid record."""
        if len(self.data) - self.at < LONGEST_RECORD and not self.whole:
            self.fill()
        return unframe(self.data, self.at, log)

    def seek(self, log: int | None) -> bool:
        """Advance :attr:`at` to the next valid record or to the end; return whether there is such a record.

        In a live log without a next record the position is unchanged, because the current record may be incomplete.
        """
        at = self.at + 1
        while True:
            at = self.data.find(MAGIC, at)
            if not self.whole and (at < 0 or len(self.data) - at < LONGEST_RECORD):
                # The last byte may be the first byte of a magic.
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
    problem = f"the wire log cannot be read ({error.strerror or one_line(error)})"
    return NotALog(path, problem, "name a log that springmass record wrote")
