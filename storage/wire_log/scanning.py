"""Read wire logs: return every valid record, even of a badly damaged file, and count the missing records.

Damage to a file raises no error. After damage the reader continues at the next magic whose record has a correct
checksum, the number of the log and an increasing sequence number. The bytes between are counted, never interpreted.
"""

from __future__ import annotations

import hashlib
import os
import weakref
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import FileIO
from pathlib import Path

from acquisition.regular_file import open_regular
from storage.errors import NotALog, one_line
from storage.locks import is_locked
from storage.schema import ValueRefused
from storage.wire_log.records import (
    LONGEST_RECORD,
    RECORD_HEAD_BYTES,
    WIRE_MAGIC,
    WRAP,
    LogHeader,
    Record,
    RecordKind,
    unframe,
)

FOREIGN = "springmass does not write such logs; ask where it comes from"
PIECE_BYTES = 1 << 20
"""Number of bytes that are read at a time."""


@dataclass(slots=True)
class Damage:
    """The damage of the bytes that a scan has read.

    ``lost`` records are missing according to the sequence numbers, ``skipped_bytes`` between records belong to no
    record (the first at ``skipped_at``), and ``tail_bytes`` follow the last valid record. ``strays`` are valid records
    whose sequence number runs backward, copies of earlier ones that are not delivered. ``ended`` states whether the
    last record is the end record of a recording.
    """

    records: int = 0
    lost: int = 0
    skipped_bytes: int = 0
    skipped_at: int = -1
    strays: int = 0
    tail_bytes: int = 0
    ended: bool = False

    @property
    def intact(self) -> bool:
        """Whether every byte belongs to a record, and no record before the last is missing."""
        return not (self.lost or self.skipped_bytes or self.strays or self.tail_bytes)

    def describe(self) -> str:
        """Return one line for the user."""
        parts = [f"{self.records} records"]
        if self.lost:
            parts.append(f"{self.lost} lost")
        if self.skipped_bytes:
            parts.append(f"{self.skipped_bytes} damaged bytes skipped, first at byte {self.skipped_at}")
        if self.strays:
            parts.append(f"{self.strays} out of order left out")
        if self.tail_bytes:
            parts.append(f"{self.tail_bytes} damaged bytes at the end")
        return ", ".join(parts) + ("" if self.ended else "; the recording was cut short")


class Scan:
    """One pass over a log, from its first byte: finished, damaged or growing.

    ``read`` returns at most so many bytes (its second argument) from a position of the log (its first one).
    """

    def __init__(self, read: Callable[[int, int], bytes]) -> None:
        self.damage = Damage()
        self._read = read
        self._log: int | None = None
        self._end = 0  # of the last valid record
        self._expected = 0

    def records(self, size: int) -> Iterator[Record]:
        """Yield the valid records in the first ``size`` bytes of the log that were not yielded before.

        The bytes after the last of them are read again in the next call, because the log may grow there.
        """
        damage, data, base, at = self.damage, b"", self._end, 0
        while True:
            while len(data) - at < LONGEST_RECORD and base + len(data) < size:
                more = self._read(base + len(data), min(PIECE_BYTES, size - base - len(data)))
                size = size if more else base + len(data)  # somebody has cut the file meanwhile
                data, base, at = data[at:] + more, base + at, 0
            record = unframe(data, at, self._log)
            if record is None:
                if at >= len(data):
                    break
                following = data.find(WIRE_MAGIC, at + 1)
                at = following if following >= 0 else max(at + 1, len(data) - 1)  # the last byte may begin a magic
                continue
            sequence, mono_ns, self._log, kind, channel, payload = record
            offset = base + at
            if skipped := offset - self._end:
                damage.skipped_at = damage.skipped_at if damage.skipped_bytes else self._end
                damage.skipped_bytes += skipped
            at += RECORD_HEAD_BYTES + len(payload)
            self._end = base + at
            missing = (sequence - self._expected) % WRAP
            if missing >= WRAP // 2:
                damage.strays += 1
                continue
            self._expected = sequence + 1
            damage.records += 1
            damage.lost += missing
            damage.ended = kind is RecordKind.END
            yield Record(offset, sequence, mono_ns, kind, channel, payload, missing)
        damage.tail_bytes = size - self._end


class LogContents:
    """An open log. Every iteration reads its first ``size`` bytes again, in little memory.

    It remains readable if the log is renamed or deleted, because the file stays open until :meth:`close` or the end of
    this object.
    """

    def __init__(self, path: Path, file: FileIO) -> None:
        self.path, self._file = path, file
        self.size = 0
        self._damage: Damage | None = None
        self.close = weakref.finalize(self, file.close)
        self.grow()

    def __iter__(self) -> Iterator[Record]:
        scan = self.scan()
        yield from scan.records(self.size)
        self._damage = scan.damage

    def scan(self) -> Scan:
        """Return a new pass over the log."""
        return Scan(self._read)

    def grow(self) -> int:
        """Take over the present size of the file, and return it."""
        self.size, self._damage = os.fstat(self._file.fileno()).st_size, None
        return self.size

    @property
    def damage(self) -> Damage:
        """The damage found by the last complete iteration; if there was none, the log is read first."""
        if self._damage is None:
            for _ in self:
                pass
        assert self._damage is not None
        return self._damage

    @property
    def header(self) -> LogHeader | None:
        """The first header; None if both copies are lost. Raises NotALog for a value that is not allowed."""
        payload = next((record.payload for record in self if record.kind is RecordKind.HEADER), None)
        try:
            return None if payload is None else LogHeader.decode(payload)
        except ValueRefused as error:
            raise NotALog(self.path, str(error), FOREIGN) from error

    def pieces(self) -> Iterator[bytes]:
        """Yield all bytes of the log."""
        at = 0
        while piece := self._read(at, min(PIECE_BYTES, self.size - at)):
            yield piece
            at += len(piece)

    def sha256(self) -> str:
        """Return the SHA-256 of all bytes, as they are on the disk now."""
        digest = hashlib.sha256()
        for piece in self.pieces():
            digest.update(piece)
        return digest.hexdigest()

    def being_written(self) -> bool:
        """Return whether the writer of the log, in this process or another, still holds its lock.

        False on Windows and on a disk without locks, where this is unknown.
        """
        return is_locked(self._file)

    def remove(self) -> bool:
        """Remove the log unless it has grown or its name leads to another file; return whether it was removed."""
        try:
            opened, there = os.fstat(self._file.fileno()), os.stat(self.path)
            if not os.path.samestat(opened, there) or there.st_size != self.size:
                return False
            self.close()
            self.path.unlink()
        except OSError:
            return False
        return True

    def _read(self, at: int, count: int) -> bytes:
        try:
            self._file.seek(at)
            return self._file.read(count) or b""
        except OSError as error:
            raise _unreadable(self.path, error) from error


def read_log(path: str | os.PathLike[str]) -> LogContents:
    """Open a log, whether finished, damaged or still being written; a file that is not a log has no records.

    Raises NotALog if the file cannot be read.
    """
    path = Path(path)
    try:
        return LogContents(path, open_regular(path))
    except OSError as error:
        raise _unreadable(path, error) from error


def _unreadable(path: Path, error: OSError) -> NotALog:
    problem = f"the wire log cannot be read ({error.strerror or one_line(error)})"
    return NotALog(path, problem, "name a log that springmass record wrote")
