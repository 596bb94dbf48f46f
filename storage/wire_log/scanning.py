"""Reading wire logs: every sound record, whatever happened to the file around it, and what is missing.

Nothing that a file holds raises. After damage the reader is back in step at the next magic whose record has a true
checksum, the log's own number and a sequence number that goes forward; what lies between is counted, never guessed.
"""

from __future__ import annotations

import io
import os
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from storage.errors import StorageError, one_line
from storage.wire_log.records import HEAD_BYTES, MAGIC, MAX_PAYLOAD, Kind, LogHeader, Parts, Record, unframe

__all__ = ["Damage", "LogContents", "NotALog", "Record", "parse_log", "read_log"]

KEPT_STRETCHES = 100
_LONGEST = HEAD_BYTES + MAX_PAYLOAD
_CHUNK = 1 << 20
_DATA, _END = Kind.DATA, Kind.END  # looked up once, and not for each record
_NOTES = (Kind.MARK, Kind.EVENT)


class NotALog(StorageError):
    """A path that holds no wire log, or one of which nothing can be read."""


@dataclass(frozen=True, slots=True)
class Damage:
    """What reading a log to its end found.

    Parameters
    ----------
    records : int
        Sound records.
    lost : int
        Records missing by their numbers, or incomplete. What is missing after the last sound one has no number.
    skipped_bytes : int
        Bytes between records that belong to none.
    stretches : tuple of (int, int)
        Offset and length of the first hundred such stretches.
    strays : int
        Sound records whose number runs back: copies of earlier ones. They are not delivered.
    tail_bytes : int
        Bytes after the last sound record: a record cut short, pages never written.
    ended : bool
        Whether the last record is the end that a recording closes with.
    """

    records: int = 0
    lost: int = 0
    skipped_bytes: int = 0
    stretches: tuple[tuple[int, int], ...] = ()
    strays: int = 0
    tail_bytes: int = 0
    ended: bool = False

    @property
    def intact(self) -> bool:
        """Whether every byte belongs to a record, and every record up to the last is there."""
        return not (self.lost or self.skipped_bytes or self.strays or self.tail_bytes)

    def describe(self) -> str:
        """Return one line for people."""
        parts = [f"{self.records} records"]
        if self.lost:
            parts.append(f"{self.lost} lost")
        if self.skipped_bytes:
            parts.append(f"{self.skipped_bytes} damaged bytes skipped, first at byte {self.stretches[0][0]}")
        if self.strays:
            parts.append(f"{self.strays} out of order left out")
        if self.tail_bytes:
            parts.append(f"{self.tail_bytes} bytes of a torn end")
        return ", ".join(parts) + ("" if self.ended else "; the recording was cut short")


class LogContents:
    """A log's records, read anew at every iteration; memory holds about a megabyte of it.

    Parameters
    ----------
    path : Path
        For messages.
    opened : callable
        Returns a binary stream at the log's first byte.
    """

    def __init__(self, path: Path, opened: Callable[[], BinaryIO]) -> None:
        self.path = path
        self._opened = opened
        self._found: tuple[Damage, tuple[Record, ...]] | None = None

    def __iter__(self) -> Iterator[Record]:
        scan = _Scan(self.path)
        notes = []
        with self._opened() as stream:
            for record in scan.records(stream):
                if record.kind is not _DATA and record.kind in _NOTES:
                    notes.append(record)
                yield record
        self._found = scan.damage(), tuple(notes)

    def _known(self) -> tuple[Damage, tuple[Record, ...]]:
        """Return what the last iteration that came to the end found; read the log where there was none."""
        if self._found is None:
            for _ in self:
                pass
        assert self._found is not None
        return self._found

    @property
    def damage(self) -> Damage:
        """What is missing, of the last iteration that came to the end; reads the log where there was none."""
        return self._known()[0]

    @property
    def notes(self) -> tuple[Record, ...]:
        """Marks and events, of the same iteration."""
        return self._known()[1]

    @property
    def header(self) -> LogHeader | None:
        """The first header that can be read; None where every copy is lost."""
        for record in self:
            if record.kind is Kind.HEADER:
                try:
                    return LogHeader.decode(record.payload)
                except (KeyError, TypeError, ValueError, AttributeError):
                    continue
        return None


def read_log(path: str | os.PathLike[str]) -> LogContents:
    """Open a log, finished, torn or still being written.

    Parameters
    ----------
    path : str or PathLike
        The log.

    Returns
    -------
    LogContents
        Of any file whatever; one that is no log has no records.

    Raises
    ------
    NotALog
        If there is no file that can be opened.
    """
    path = Path(path)

    def opened() -> BinaryIO:
        try:
            return path.open("rb", buffering=0)
        except OSError as error:
            reason = error.strerror or one_line(error)
            demand = f"a wire log was demanded, got no file that opens ({reason})"
            raise NotALog(path, demand, "name a file that springmass record left behind") from error

    opened().close()
    return LogContents(path, opened)


def parse_log(data: bytes, path: str | os.PathLike[str] = "log") -> LogContents:
    """Read a log from memory; ``path`` is what messages call it."""
    return LogContents(Path(path), lambda: io.BytesIO(data))


class _Scan:
    """One pass over a log."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._window = b""
        self._at = 0  # index in the window of the next byte not yet accounted for
        self._base = 0  # offset in the file of the window's first byte
        self._whole = False  # the window reaches the end of the file
        self._log: int | None = None
        self._expected = 0
        self._records = self._lost = self._strays = self._skipped = self._tail = 0
        self._owed = 0  # lost records that the next record delivered will state
        self._stretches: list[tuple[int, int]] = []
        self._parts: list[Record] = []
        self._ended = False

    def damage(self) -> Damage:
        """Return the counts so far."""
        stretches = tuple(self._stretches)
        return Damage(self._records, self._lost, self._skipped, stretches, self._strays, self._tail, self._ended)

    def records(self, stream: BinaryIO) -> Iterator[Record]:
        """Yield what can be delivered; :meth:`damage` is complete after the last."""
        self._fill(stream)
        self._log = _number_of(self._window)
        while True:
            self._fill(stream)
            found = unframe(self._window, self._at, self._log)
            if found is None:
                if not self._resynchronise(stream):
                    break
                continue
            if (record := self._accept(*found)) is not None:
                yield record
        self._drop_parts()

    def _fill(self, stream: BinaryIO) -> None:
        """Have the longest possible record in the window, or the file's end."""
        if self._whole or len(self._window) - self._at >= _LONGEST:
            return
        pieces = [self._window[self._at :]]
        self._base += self._at
        self._at = 0
        size = len(pieces[0])
        while size < _CHUNK and not self._whole:
            try:
                piece = stream.read(_CHUNK)
            except OSError as error:
                reason = error.strerror or one_line(error)
                demand = f"the wire log cannot be read past byte {self._base + size} ({reason})"
                raise NotALog(self._path, demand, "copy what the disk still gives, and name the copy") from error
            self._whole = not piece
            pieces.append(piece)
            size += len(piece)
        self._window = b"".join(pieces)

    def _resynchronise(self, stream: BinaryIO) -> bool:
        """Go to the next sound record and count what lies before it; False where there is none."""
        start = self._base + self._at
        while True:
            found = self._window.find(MAGIC, self._at + 1)
            if found < 0 and self._whole:
                self._tail = self._base + len(self._window) - start
                return False
            # A window's last byte may be the first half of a magic.
            self._at = found if found >= 0 else max(self._at, len(self._window) - 2)
            self._fill(stream)
            if found >= 0 and unframe(self._window, self._at, self._log) is not None:
                break
        length = self._base + self._at - start
        self._skipped += length
        if len(self._stretches) < KEPT_STRETCHES:
            self._stretches.append((start, length))
        return True

    def _accept(
        self, sequence: int, mono_ns: int, log: int, kind: Kind, channel: int, parts: int, payload: bytes
    ) -> Record | None:
        offset = self._base + self._at
        self._at += HEAD_BYTES + len(payload)
        self._log = log
        missing = (sequence - self._expected) % (1 << 32)
        if missing >= 1 << 31:
            self._strays += 1
            return None
        self._expected = sequence + 1
        self._records += 1
        self._lost += missing
        self._owed += missing
        self._ended = kind is _END
        if kind is not _DATA:
            joined = self._joined(Record(offset, sequence, mono_ns, kind, channel, payload), parts, missing)
            if joined is None:
                return None
            offset, sequence, mono_ns, _, _, payload, _ = joined
        elif self._parts:
            self._drop_parts()
        owed, self._owed = self._owed, 0
        return Record(offset, sequence, mono_ns, kind, channel, payload, owed)

    def _joined(self, record: Record, parts: int, missing: int) -> Record | None:
        """Return a text whose parts are all there, None before its last one or where one is missing."""
        goes_on_from = bool(parts & Parts.GOES_ON_FROM)
        if self._parts and (missing or not goes_on_from or self._parts[0].kind is not record.kind):
            self._drop_parts()
        if goes_on_from and not self._parts:
            self._lost += 1
            self._owed += 1
            return None
        self._parts.append(record)
        if parts & Parts.GOES_ON:
            return None
        whole, self._parts = self._parts, []
        return whole[0]._replace(payload=b"".join(part.payload for part in whole))

    def _drop_parts(self) -> None:
        self._lost += len(self._parts)
        self._owed += len(self._parts)
        self._parts = []


def _number_of(window: bytes) -> int | None:
    """Return the number of the log: that of its first record, which was on the disk before the run began.

    Where that is lost, most of the sound records decide: the first of them may be one that a device sent, or one of
    an old log whose blocks show through. None where there are none.
    """
    if (first := unframe(window, 0, None)) is not None:
        return first[2]
    numbers: Counter[int] = Counter()
    at = window.find(MAGIC)
    while at >= 0 and numbers.total() < 1000:
        found = unframe(window, at, None)
        numbers.update([] if found is None else [found[2]])
        at = window.find(MAGIC, at + 1 if found is None else at + HEAD_BYTES + len(found[-1]))
    return numbers.most_common(1)[0][0] if numbers else None
