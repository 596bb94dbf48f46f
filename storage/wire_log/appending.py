"""Write the wire log: the exact bytes from the port, one checksummed record per read, appended and never changed.

:class:`WireLogWriter` appends; :func:`storage.wire_log.scanning.read_log` reads a log, even a damaged one.
:mod:`storage.wire_log.records` defines the layout of a record.

Examples
--------
>>> import tempfile
>>> from storage.wire_log.records import SensorEntry
>>> from storage.wire_log.scanning import read_log
>>> header = LogHeader(sensors=(SensorEntry(0, "maxbotix", "COM3", 9600),), mono_ns=0, unix_ns=0)
>>> with tempfile.TemporaryDirectory() as folder:
...     log = WireLogWriter(folder + "/run.wire", header)
...     log.append(Kind.DATA, b"R0500\\r", mono_ns=10_000_000)
...     log.close()
...     for record in read_log(folder + "/run.wire"):
...         print(record.sequence, record.kind.name, len(record.payload))
1
0 HEADER 265
1 DATA 6
"""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import threading
from collections.abc import Callable, Iterable
from itertools import accumulate
from pathlib import Path
from typing import NamedTuple

from storage.errors import RunExists, WriteFailed, one_line
from storage.wire_log.log_file import LogFile, open_log_file
from storage.wire_log.records import Kind, LogHeader, ends_item, frames

__all__ = ["Item", "LogFile", "WireLogWriter", "Written", "open_log_file"]

FIRST_COPY = 8192
"""Offset in the log after which the header is repeated for the first time, bytes."""
WRITE_BYTES = 1 << 18
"""Size of a batch of queued records at which it is written, bytes."""
_APPEND = os.O_WRONLY | os.O_APPEND  # without O_CREAT: the file must exist

Item = tuple[Kind, int, int, bytes]
"""The parts of a record: kind, channel, time on the host's monotonic clock in ns, payload."""


class Written(NamedTuple):
    """Size of a log: number of records, and size of the file in bytes."""

    records: int = 0
    bytes: int = 0


class WireLogWriter:
    """Appends records to a new log.

    One thread appends; others may call :meth:`sync` at the same time. :attr:`written` counts the records that the
    kernel has accepted, ``synced`` those on the disk, and ``extended`` the items of the last :meth:`extend` that are
    completely in the log.

    Parameters
    ----------
    path : str or PathLike
        The log to create; its folder must exist.
    header : LogHeader
        The first record, which is written and synced before the constructor returns.
    open_file : callable
        Creates the file; tests replace it.
    log : int, optional
        The log number in all records; random by default.

    Raises
    ------
    RunExists
        If the file exists: a recording is never overwritten.
    WriteFailed
        If the log cannot be created; in this case no file remains.
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
        self.written = self.synced = Written()
        self.extended = 0
        self._log = secrets.randbits(32) if log is None else log
        self._next_copy = FIRST_COPY
        self._syncing = threading.Lock()
        self._counting = threading.Lock()
        self._in_flight = (0, 0)  # numbers of records and whole items in a write that has not returned yet
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
            self.append(Kind.HEADER, self._header, mono_ns=header.mono_ns)
            self.sync()
        except BaseException:
            with contextlib.suppress(OSError):
                self._file.close()
                self.path.unlink()
            raise

    def append(self, kind: Kind, payload: bytes, *, mono_ns: int, channel: int = 0) -> int:
        """Append a record, or several if the payload is long.

        Parameters
        ----------
        kind : Kind
        payload : bytes
        mono_ns : int
            Host's monotonic clock, ns.
        channel : int
            0 to 255.

        Returns
        -------
        int
            Sequence number of the last record written.

        Raises
        ------
        WriteFailed
            If the disk does not accept the whole record. The writer then refuses further records; earlier ones remain.
        """
        self.extend(((kind, channel, mono_ns, payload),))
        return self.written.records - 1

    def extend(self, items: Iterable[Item]) -> None:
        """Append the records of many items in few writes.

        Parameters
        ----------
        items : iterable of Item

        Raises
        ------
        WriteFailed
            If the disk does not accept all of them. The writer then refuses further items; :attr:`extended` counts the
            items that are completely in the log.
        """
        self.extended = 0
        if error := self._append_error or self._sync_error:
            raise error
        batch: list[bytes] = []
        items_in_batch, end = 0, self.written.bytes
        try:
            for kind, channel, mono_ns, payload in items:
                if end >= self._next_copy:
                    # The interval doubles: a day's log has about twenty copies, and a zeroed page cannot destroy all.
                    # The copy is written first, so that an error always means that the record itself is incomplete.
                    self._next_copy = 2 * end
                    end += self._lay(batch, Kind.HEADER, 0, mono_ns, self._header)
                end += self._lay(batch, kind, channel, mono_ns, payload)
                items_in_batch += 1
                if end - self.written.bytes >= WRITE_BYTES:
                    whole, batch = batch, []
                    self._write(whole, items_in_batch)
                    items_in_batch = 0
        finally:
            if batch:
                self._write(batch, items_in_batch)

    def _lay(self, batch: list[bytes], kind: Kind, channel: int, mono_ns: int, payload: bytes) -> int:
        """Add an item's records to a batch; return their size in bytes."""
        before = len(batch)
        sequence = self.written.records + before
        batch += frames(kind, payload, sequence=sequence, mono_ns=mono_ns, log=self._log, channel=channel)
        return sum(map(len, batch[before:]))

    def _write(self, batch: list[bytes], items: int) -> None:
        """Write the records of some items, and count those that are completely in the log."""
        if not batch:
            return
        data = b"".join(batch)
        taken = 0
        with self._counting:
            if self._append_error:
                raise self._append_error
            self._in_flight = len(batch), items
        try:
            taken = self._file.write(data)
            while taken < len(data):  # a nearly full disk accepts a part, then reports the error
                more = self._file.write(memoryview(data)[taken:])
                if more <= 0:
                    raise OSError(errno.EIO, f"only {taken} of {len(data)} bytes were written")
                taken += more
        except OSError as error:
            whole = [record for record, end in zip(batch, accumulate(map(len, batch)), strict=True) if end <= taken]
            self._count(len(whole), sum(map(len, whole)), sum(map(ends_item, whole)))
            self._append_error = self._failed("could not be continued", error)
            raise self._append_error from error
        self._count(len(batch), taken, items)

    def _count(self, records: int, size: int, items: int) -> None:
        with self._counting:
            self.written = Written(self.written.records + records, self.written.bytes + size)
            self.extended += items
            self._in_flight = 0, 0

    def stop(self) -> int:
        """Prevent further writes; return how many items of the last call are in the log or in a write that hangs."""
        with self._counting:
            self._append_error = self._append_error or WriteFailed(
                self.path, "the recording was ended while the disk did not respond", "check the disk"
            )
            return self.extended + self._in_flight[1]

    def append_beside(self, items: Iterable[Item]) -> None:
        """Append and sync items through a second descriptor while another write hangs; call :meth:`stop` first.

        Notes
        -----
        The sequence numbers follow those of the write that hangs. If that write never reaches the log, its numbers are
        missing, and every reader of the log counts them as lost.

        Raises
        ------
        OSError
            If the disk does not accept all items, or the log no longer exists under its name.
        """
        batch: list[bytes] = []
        with self._counting:
            sequence = self.written.records + self._in_flight[0]
        for kind, channel, mono_ns, payload in items:
            batch += frames(
                kind, payload, sequence=sequence + len(batch), mono_ns=mono_ns, log=self._log, channel=channel
            )
        with open(self.path, "ab", buffering=0, opener=lambda name, _: os.open(name, _APPEND)) as file:
            data = memoryview(b"".join(batch))
            while data:
                data = data[file.write(data) :]
            os.fsync(file.fileno())

    def sync(self) -> Written:
        """Sync everything appended before the call to the disk, and return its size.

        Raises
        ------
        WriteFailed
            If the sync fails. The records that :attr:`synced` counts are safe. The state of later ones is unknown: a
            kernel forgets which pages it failed to write, so a later successful sync would prove nothing.
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
        return reached

    def close(self) -> None:
        """Close the file without syncing it; call this only once.

        Raises
        ------
        WriteFailed
            If the disk reports an earlier error only at this point.
        """
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
