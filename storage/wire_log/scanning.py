"""Reading wire logs: every sound record, whatever happened to the file around it, and what is missing.

Nothing that a file holds raises. After damage the reader is back in step at the next magic whose record has a true
checksum, the log's own number and a sequence number that goes forward; what lies between is counted, never guessed.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from acquisition.regular import open_regular
from storage.errors import StorageError, one_line
from storage.wire_log.records import HEAD_BYTES, MAGIC, Kind, LogHeader, Parts, Record, unframe

__all__ = ["Damage", "LogContents", "NotALog", "Record", "parse_log", "read_log"]

KEPT_STRETCHES = 100
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
    """A log's records, found anew at every iteration.

    Parameters
    ----------
    path : Path
        For messages.
    data : bytes
        The log.
    """

    def __init__(self, path: Path, data: bytes) -> None:
        self.path = path
        self.data = data
        self._found: tuple[Damage, tuple[Record, ...]] | None = None

    def __iter__(self) -> Iterator[Record]:
        scan = _Scan(self.data)
        notes = []
        for record in scan.records():
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
        If there is no file that can be read.
    """
    path = Path(path)
    try:
        with open_regular(path) as file:
            return LogContents(path, file.read())
    except OSError as error:
        demand = f"a wire log was demanded, got no file that can be read ({error.strerror or one_line(error)})"
        raise NotALog(path, demand, "name a file that springmass record left behind") from error


def parse_log(data: bytes, path: str | os.PathLike[str] = "log") -> LogContents:
    """Read a log from memory; ``path`` is what messages call it."""
    return LogContents(Path(path), data)


class _Scan:
    """One pass over a log."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0  # the next byte not yet accounted for
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

    def records(self) -> Iterator[Record]:
        """Yield what can be delivered; :meth:`damage` is complete after the last."""
        self._log = _number_of(self._data)
        while True:
            found = unframe(self._data, self._at, self._log)
            if found is None:
                if not self._resynchronise():
                    break
            elif (record := self._accept(*found)) is not None:
                yield record
        self._drop_parts()

    def _resynchronise(self) -> bool:
        """Go to the next sound record and count what lies before it; False where there is none."""
        start, at = self._at, self._data.find(MAGIC, self._at + 1)
        while at >= 0 and unframe(self._data, at, self._log) is None:
            at = self._data.find(MAGIC, at + 1)
        if at < 0:
            self._tail = len(self._data) - start
            return False
        self._at = at
        self._skipped += at - start
        if len(self._stretches) < KEPT_STRETCHES:
            self._stretches.append((start, at - start))
        return True

    def _accept(
        self, sequence: int, mono_ns: int, log: int, kind: Kind, channel: int, parts: int, payload: bytes
    ) -> Record | None:
        offset = self._at
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


def _number_of(data: bytes) -> int | None:
    """Return the number of the log: that of its first record, which was on the disk before the run began.

    Where that is lost, most of the sound records decide: the first of them may be one that a device sent, or one of
    an old log whose blocks show through. None where there are none.
    """
    if (first := unframe(data, 0, None)) is not None:
        return first[2]
    numbers: Counter[int] = Counter()
    at = data.find(MAGIC)
    while at >= 0 and numbers.total() < 1000:
        found = unframe(data, at, None)
        numbers.update([] if found is None else [found[2]])
        at = data.find(MAGIC, at + 1 if found is None else at + HEAD_BYTES + len(found[-1]))
    return numbers.most_common(1)[0][0] if numbers else None
