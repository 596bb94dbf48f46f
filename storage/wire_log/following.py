"""A wire log read while it is written, as a page beside the recording does: by a process of its own, from the file."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

from acquisition.regular_file import open_regular
from storage.errors import one_line
from storage.wire_log.records import HEAD_BYTES, Kind, LogHeader, Parts, Record, part_path, unframe
from storage.wire_log.window import LONGEST, STRETCH, NotALog

__all__ = ["LogFollower"]

_DATA, _HEADER, _GOES_ON = Kind.DATA, Kind.HEADER, int(Parts.GOES_ON)  # looked up once, and not for each record
LOOK = 1 << 14
"""Bytes asked for at first: room for a long stretch, taken and given back at each look, costs more than the look."""
PASSED_OVER = 100
"""The writer passes over so many names that are taken when it goes on in another file."""


class LogFollower:
    """Gives a growing log's records, each once.

    It only reads: whatever becomes of it, the recording goes on. Records count when they are whole in the file, so what
    it gives has been taken by the log.

    Parameters
    ----------
    path : Path
        The log's first file.

    Attributes
    ----------
    header : LogHeader
    ended : bool
        Whether the end record came.

    Raises
    ------
    NotALog
        If no header stands at its beginning.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._files = 1
        self._data, self._offset, self._ask = b"", 0, LOOK
        self._parts: list[bytes] = []
        self._log: int | None = None
        self.ended = False
        self._file = _opened(path)
        self._waiting: list[Record] = []
        there = self.records()
        if not there or there[0].kind is not Kind.HEADER:
            self.close()
            raise NotALog(path, "a log's header was demanded at its beginning, got none", "name the log of a recording")
        self.header = LogHeader.decode(there[0].payload)
        self._waiting = there[1:]

    def close(self) -> None:
        """Close the file; again does no harm."""
        self._file.close()

    def records(self) -> list[Record]:
        """Return the records that came since the last call; the header and its copies are left out.

        Raises
        ------
        NotALog
            If the log cannot be read any further: bytes that are no record, or a file that is gone.
        """
        found, self._waiting = self._waiting, []
        while True:
            data = self._read()
            self._data += data
            self._take(found)
            if len(self._data) >= LONGEST and not found:
                demand = f"a record was demanded at byte {self._offset}, got damaged bytes"
                raise NotALog(self._path, demand, "springmass recover reads what lies behind them")
            if found:
                return found  # the rest at the next call: a long log is shown a stretch at a time
            if not data and not self._go_on():
                return found

    def _read(self) -> bytes:
        try:
            data = self._file.read(self._ask) or b""
        except OSError as error:
            raise NotALog(self._path, f"it cannot be read ({one_line(error)})", "look at the disk") from error
        self._ask = STRETCH if len(data) == self._ask else LOOK
        return data

    def _take(self, found: list[Record]) -> None:
        at = 0
        while (unframed := unframe(self._data, at, self._log)) is not None:
            sequence, mono_ns, self._log, kind, channel, parts, payload = unframed
            size = HEAD_BYTES + len(payload)
            at += size
            offset, self._offset = self._offset, self._offset + size
            if kind is _HEADER and offset:
                continue  # a copy
            if parts & _GOES_ON or self._parts:
                self._parts.append(payload)
                if parts & _GOES_ON:
                    continue
                payload = b"".join(self._parts)
                self._parts.clear()
            found.append(Record(offset, sequence, mono_ns, kind, channel, payload))
            if kind is not _DATA:
                self.ended = kind is Kind.END
        self._data = self._data[at:]

    def _go_on(self) -> bool:
        """Open the next file where the log goes on in one."""
        if self.ended or self._data:
            return False
        for number in range(self._files, self._files + PASSED_OVER):
            path = part_path(self._path, number)
            if not path.exists():
                return False
            file = _opened(path)
            head = file.read(LONGEST) or b""
            if unframe(head, 0, self._log) is None:
                file.close()
                continue
            self._file.close()
            self._file, self._files, self._data = file, number + 1, head
            return True
        return False


def _opened(path: Path) -> BinaryIO:
    try:
        return open_regular(path)
    except OSError as error:
        raise NotALog(
            path, f"a log was demanded, got none ({error.strerror or one_line(error)})", "check the name"
        ) from error
