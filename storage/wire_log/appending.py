"""Write the wire log: the exact bytes from the port, one checksummed record per read, appended and never changed."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import secrets
import threading
from bisect import bisect_right
from collections.abc import Callable, Sequence
from itertools import accumulate
from pathlib import Path
from typing import NamedTuple, Protocol

from storage.atomic import sync_folder
from storage.errors import RunExists, WriteFailed, one_line
from storage.locks import lock
from storage.wire_log.records import LogHeader, RecordKind, frame


class LogFile(Protocol):
    """The interface between the log's writer and the disk; tests replace it with a failing one."""

    def write(self, data: bytes | memoryview) -> int:
        """Append bytes; return how many of them were written, as ``os.write`` does. Raises OSError."""

    def sync(self) -> None:
        """Sync all written bytes to the disk. Raises OSError."""

    def close(self) -> None:
        """Close the file."""


class _NewFile(io.FileIO):
    """A new file that is locked while it is open and has no buffers outside the kernel."""

    # macOS and Windows have no fdatasync; fsync also syncs the metadata.
    _sync: Callable[[int], None] = staticmethod(getattr(os, "fdatasync", os.fsync))

    def __init__(self, path: Path) -> None:
        super().__init__(path, "x", opener=lambda name, flags: os.open(name, flags | os.O_APPEND, 0o666))
        with contextlib.suppress(BlockingIOError):  # somebody looks whether it is locked
            lock(self.fileno())

    def sync(self) -> None:
        self._sync(self.fileno())


def open_log_file(path: Path) -> LogFile:
    """Create a new file for appending and sync its name to the disk. Raises OSError."""
    file = _NewFile(path)
    with contextlib.suppress(OSError):  # a disk that cannot sync a folder
        sync_folder(path.parent)
    return file


SECOND_COPY = 32768
"""Size of the log after which the header is written once more, bytes."""

LogItem = tuple[RecordKind, int, int, bytes]
"""The parts of a record: kind, channel, time on the host's monotonic clock in ns, payload of at most 65535 bytes."""


class LogSize(NamedTuple):
    """Size of a log: number of records, and size of the file in bytes."""

    records: int = 0
    bytes: int = 0


class WireLogWriter:
    """Appends records to a new log, whose header is synced before the constructor returns.

    One thread appends; others may call :meth:`sync` at the same time. ``written`` counts the records that the kernel
    has accepted, ``synced`` those on the disk, and ``extended`` the items of the last :meth:`extend` in the log.

    Raises RunExists if the file exists, because a recording is never overwritten, and WriteFailed if the log cannot be
    created; in this case no file remains.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        header: LogHeader,
        *,
        open_file: Callable[[Path], LogFile] = open_log_file,
        log: int | None = None,
    ) -> None:
        self.path = Path(path)
        self.written = self.synced = LogSize()
        self.extended = 0
        self._log = secrets.randbits(32) if log is None else log
        self._copied = False
        self._syncing = threading.Lock()
        self._append_error: WriteFailed | None = None
        self._sync_error: WriteFailed | None = None
        try:
            self._header = header.encode()
        except (TypeError, ValueError) as error:
            remedy = "give the scene and options as plain texts and numbers"
            raise WriteFailed(self.path, f"the header cannot be written ({one_line(error)})", remedy) from error
        try:
            self._file = open_file(self.path)
        except FileExistsError as error:
            remedy = "choose another name, recordings are never overwritten"
            raise RunExists(self.path, "already exists", remedy) from error
        except OSError as error:
            raise self._failed("could not be made", error) from error
        try:
            self.extend([(RecordKind.HEADER, 0, header.mono_ns, self._header)])
            self.sync()
        except BaseException:
            with contextlib.suppress(OSError):
                self._file.close()
                self.path.unlink()
            raise

    def extend(self, items: Sequence[LogItem]) -> None:
        """Append the records of items in one write.

        Raises WriteFailed if the disk does not accept all of them; the writer then refuses further items.
        """
        self.extended = 0
        if refused := self._append_error or self._sync_error:
            raise refused
        if not self._copied and self.written.bytes >= SECOND_COPY:
            self._copied = True
            self.extend([(RecordKind.HEADER, 0, items[0][2], self._header)])
            self.extended = 0
        records = [
            frame(kind, payload, sequence, mono_ns, self._log, channel)
            for sequence, (kind, channel, mono_ns, payload) in enumerate(items, self.written.records)
        ]
        data, taken = b"".join(records), 0
        try:
            while taken < len(data):  # a nearly full disk accepts a part, then reports the error
                more = self._file.write(memoryview(data)[taken:])
                if more <= 0:
                    raise OSError(errno.EIO, f"only {taken} of {len(data)} bytes were written")
                taken += more
        except OSError as error:
            ends = list(accumulate(map(len, records)))
            whole = bisect_right(ends, taken)
            self._count(whole, ends[whole - 1] if whole else 0)
            self._append_error = self._failed("could not be continued", error)
            raise self._append_error from error
        self._count(len(records), len(data))

    def _count(self, records: int, size: int) -> None:
        self.written = LogSize(self.written.records + records, self.written.bytes + size)
        self.extended = records

    def sync(self) -> None:
        """Sync everything appended before the call to the disk.

        Raises WriteFailed if the sync fails. The records that ``synced`` counts are safe. The state of later ones is
        unknown: a kernel forgets which pages it failed to write, so a later successful sync would prove nothing.
        """
        with self._syncing:
            if self._sync_error:
                raise self._sync_error
            reached = self.written
            try:
                self._file.sync()
            except OSError as error:
                self._sync_error = self._failed("could not be synced to the disk", error)
                raise self._sync_error from error
            self.synced = reached

    def close(self) -> None:
        """Close the file without syncing it; call this only once. Raises WriteFailed for an error that comes late."""
        try:
            self._file.close()
        except OSError as error:
            raise self._failed("could not be closed", error) from error

    def _failed(self, what: str, error: OSError) -> WriteFailed:
        reason = error.strerror or one_line(error)
        remedy = "check the disk space and the permissions"
        if self.written.records:
            remedy += f"; {self.written.records} records ({self.written.bytes} bytes) are kept"
        return WriteFailed(self.path, f"the wire log {what} ({reason})", remedy)
