"""Scan the bytes of a log once: find the valid records in order and count what is missing between them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from storage.wire_log.records import HEAD_BYTES, MOST_PARTS, Kind, Parts, Record, Unframed
from storage.wire_log.window import Window

__all__ = ["Damage", "Scan"]

MAX_STRETCHES = 100


@dataclass(frozen=True, slots=True)
class Damage:
    """The damage of a log that was read to its end.

    Parameters
    ----------
    records : int
        Number of valid records.
    lost : int
        Number of missing or incomplete records, derived from the sequence numbers. Losses after the last valid record
        are not counted.
    skipped_bytes : int
        Number of bytes between records that belong to no record.
    stretches : tuple of (int, int)
        Offset and length of the first hundred stretches of such bytes.
    strays : int
        Number of valid records whose sequence number runs backward: copies of earlier ones. They are not delivered.
    tail_bytes : int
        Number of bytes after the last valid record: an incomplete record, or pages that were never written.
    ended : bool
        Whether the last record is the end record of a recording.
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
        """Whether every byte belongs to a record, and no record before the last is missing."""
        return not (self.lost or self.skipped_bytes or self.strays or self.tail_bytes)

    def describe(self) -> str:
        """Return one line for the user."""
        parts = [f"{self.records} records"]
        if self.lost:
            parts.append(f"{self.lost} lost")
        if self.skipped_bytes:
            parts.append(f"{self.skipped_bytes} damaged bytes skipped, first at byte {self.stretches[0][0]}")
        if self.strays:
            parts.append(f"{self.strays} out of order left out")
        if self.tail_bytes:
            parts.append(f"{self.tail_bytes} damaged bytes at the end")
        return ", ".join(parts) + ("" if self.ended else "; the recording was cut short")


class Scan:
    """One pass over a log."""

    def __init__(self, window: Window, log: int | None) -> None:
        self._window = window
        self._log = log
        self._expected = 0
        self._records = self._lost = self._strays = self._skipped = self._tail = 0
        self._unreported = 0  # number of lost records that the next delivered record will report
        self._stretches: list[tuple[int, int]] = []
        self._parts: list[Record] = []
        self._ended = False

    def damage(self) -> Damage:
        """Return the counts so far."""
        stretches = tuple(self._stretches)
        return Damage(self._records, self._lost, self._skipped, stretches, self._strays, self._tail, self._ended)

    def records(self) -> Iterator[Record]:
        """Yield the valid records; :meth:`damage` is complete after the last.

        For a live log, this call yields the records so far, and the next call yields later ones.
        """
        window = self._window
        if window.live:
            window.fill()
        while True:
            unframed = window.record(self._log)
            if unframed is None:
                if not self._resynchronise():
                    break
            elif (record := self._accept(unframed)) is not None:
                yield record
        if not window.live:
            self._drop_parts()

    def _resynchronise(self) -> bool:
        """Advance to the next valid record and count the bytes before it; return False if there is none."""
        start = self._window.offset
        is_there = self._window.seek(self._log)
        length = self._window.offset - start
        if not (is_there or self._window.live):
            self._tail = length
        elif length:
            self._skipped += length
            if len(self._stretches) < MAX_STRETCHES:
                self._stretches.append((start, length))
        return is_there

    def _accept(self, unframed: Unframed) -> Record | None:
        sequence, mono_ns, _, kind, channel, parts, payload = unframed
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
        self._unreported += missing
        self._ended = kind is Kind.END
        if kind is not Kind.DATA:
            joined = self._joined(Record(offset, sequence, mono_ns, kind, channel, payload), parts, missing)
            if joined is None:
                return None
            offset, sequence, mono_ns, _, _, payload, _ = joined
        elif self._parts:
            self._drop_parts()
        lost_before, self._unreported = self._unreported, 0
        return Record(offset, sequence, mono_ns, kind, channel, payload, lost_before)

    def _joined(self, record: Record, parts: int, missing: int) -> Record | None:
        """Return a joined record when all its parts are present; None before the last part or if one is missing."""
        goes_on_from = bool(parts & Parts.GOES_ON_FROM)
        if self._parts and (missing or not goes_on_from or self._parts[0].kind is not record.kind):
            self._drop_parts()
        if goes_on_from and not self._parts:
            self._lost += 1
            self._unreported += 1
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
        self._unreported += len(self._parts)
        self._parts = []
