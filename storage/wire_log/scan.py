"""One pass over the bytes of a log: which records are sound and in order, and what is missing between them."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass

from storage.wire_log.log_header import LATEST_NS
from storage.wire_log.records import CRC_AT, HEAD_BYTES, MAGIC, MOST_PARTS, Kind, Parts, Record, Unframed, unpack_head
from storage.wire_log.window import LONGEST, Window

__all__ = ["Damage", "Scan"]

KEPT_STRETCHES = 100
_DATA, _END = Kind.DATA, Kind.END  # looked up once, and not for each record
_record = tuple.__new__


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


class Scan:
    """One pass over a log."""

    def __init__(self, window: Window, log: int | None) -> None:
        self._window = window
        self._log = log
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
        """Yield what can be delivered; :meth:`damage` is complete after the last.

        Of a live log that is what has come; the next call yields what comes later.
        """
        window = self._window
        if window.live:
            window.fill()
        while True:
            if not (self._owed or self._parts):
                yield from self._run()
            found = window.record(self._log)
            if found is None:
                if not self._resynchronise():
                    break
            elif (record := self._accept(found)) is not None:
                yield record
        if not window.live:
            self._drop_parts()

    def _run(self) -> Iterator[Record]:
        """Yield data records as long as nothing is wrong with them: nearly all of a log, in half the time.

        The first that is anything else is left to :meth:`records`.
        """
        window = self._window
        data, at, log, expected = window.data, window.at, self._log, self._expected
        last = len(data) - (HEAD_BYTES if window.whole else LONGEST)
        unpack, crc32, code_of_data = unpack_head, zlib.crc32, int(_DATA)
        while at <= last:
            magic, length, sequence, mono_ns, found, code, channel, parts, crc = unpack(data, at)
            if (
                code != code_of_data
                or sequence != expected
                or magic != MAGIC
                or found != log
                or parts
                or not 0 <= mono_ns <= LATEST_NS
            ):
                break
            start = at + HEAD_BYTES
            payload = data[start : start + length]
            if crc != crc32(payload, crc32(data[at : at + CRC_AT])):
                break
            yield _record(Record, (window.base + at, sequence, mono_ns, _DATA, channel, payload, 0))
            at = start + length
            expected += 1
        if read := expected - self._expected:
            self._expected, self._records, self._ended = expected, self._records + read, False
            window.at = at

    def _resynchronise(self) -> bool:
        """Go to the next sound record and count what lies before it; False where there is none."""
        start = self._window.offset
        found = self._window.seek(self._log)
        length = self._window.offset - start
        if not (found or self._window.live):
            self._tail = length
        elif length:
            self._skipped += length
            if len(self._stretches) < KEPT_STRETCHES:
                self._stretches.append((start, length))
        return found

    def _accept(self, found: Unframed) -> Record | None:
        sequence, mono_ns, _, kind, channel, parts, payload = found
        window = self._window
        offset = window.offset
        window.at += HEAD_BYTES + len(payload)
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
        return _record(Record, (offset, sequence, mono_ns, kind, channel, payload, owed))

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
            if len(self._parts) >= MOST_PARTS:
                self._drop_parts()
            return None
        whole, self._parts = self._parts, []
        return whole[0]._replace(payload=b"".join(part.payload for part in whole))

    def _drop_parts(self) -> None:
        self._lost += len(self._parts)
        self._owed += len(self._parts)
        self._parts = []
