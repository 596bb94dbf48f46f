"""Define the layout of a wire log: the bytes of a record.

A log is a sequence of records and nothing else, little-endian::

    offset  size  field
         0     2  magic      F5 A9; F5 occurs in no UTF-8 text
         2     2  length     u16, bytes of payload
         4     4  sequence   u32, number of the record, counted from 0, modulo 2^32
         8     8  mono_ns    i64, ns, host's monotonic clock: time of the read for data, of the event otherwise
        16     4  log        u32, random, the same in every record of a log
        20     1  kind       1 header, 2 data, 3 mark, 4 event, 5 end
        21     1  channel    u8, the sensor; 0 if the record belongs to no sensor
        22     2  parts      u16, bit 0: continues in the next record; bit 1: continues the previous one
        24     4  crc32      of bytes 0 to 23 and the payload (zlib's polynomial)
        28        payload

``log`` distinguishes the records from those of another log: an old log whose disk blocks reappear after a power cut,
or a log that a device sends as its data. Payloads over 65535 bytes are split into consecutive parts.

=======  ====================================================================================================
header   JSON, see :class:`LogHeader`. Repeated after 8, 16, 32, ... KiB, so that no lost page destroys all copies
data     the bytes of one read of a port
mark     UTF-8 text
event    JSON ``{"kind": text, "facts": {...}}``: lost, reopened, timeout, overflow, trigger, calibration, ...
end      JSON, counts; its absence means that the recording was cut short
=======  ====================================================================================================
"""

from __future__ import annotations

import enum
import struct
import zlib
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from storage.schema import ValueRefused, json_text, parsed
from storage.wire_log.log_header import LATEST_NS, LONGEST_TEXT, LogHeader, SensorEntry

__all__ = [
    "HEAD_BYTES",
    "HIGHEST_CHANNEL",
    "MAGIC",
    "MAX_PAYLOAD",
    "Kind",
    "LogHeader",
    "Parts",
    "Record",
    "SensorEntry",
    "ends_item",
    "event_payload",
    "frame",
    "frames",
    "unframe",
]

HIGHEST_CHANNEL = 255
"""Maximum channel number: a record has one byte for it."""

MAGIC = b"\xf5\xa9"
MAX_PAYLOAD = 65535
MOST_PARTS = LONGEST_TEXT // MAX_PAYLOAD
"""Maximum number of parts of a mark, event or header; longer ones are not joined."""
_HEAD = struct.Struct("<2sHIqIBBH")
_CRC = struct.Struct("<I")
_HEAD_AND_CRC = struct.Struct(_HEAD.format + "I")
HEAD_BYTES = _HEAD_AND_CRC.size
_WRAP = 1 << 32


class Kind(enum.IntEnum):
    """The kind of a record; the values are stored in logs and never change."""

    HEADER = 1
    DATA = 2
    MARK = 3
    EVENT = 4
    END = 5


class Parts(enum.IntFlag):
    """Flags that show how a record continues its neighbours if a payload was split."""

    GOES_ON = 1
    GOES_ON_FROM = 2


_KINDS = {kind.value: kind for kind in Kind}
_ALL_PARTS = int(Parts.GOES_ON | Parts.GOES_ON_FROM)


class Record(NamedTuple):
    """One record. Split marks, events and headers are joined again; split data are delivered part by part.

    Parameters
    ----------
    offset : int
        Offset of the record in the log, bytes.
    sequence : int
        Number of the record as written, modulo 2^32.
    mono_ns : int
        Time on the host's monotonic clock, ns.
    kind : Kind
    channel : int
    payload : bytes
    lost_before : int
        Number of missing records between the previously delivered one and this one. No frame may span them.
    """

    offset: int
    sequence: int
    mono_ns: int
    kind: Kind
    channel: int
    payload: bytes
    lost_before: int = 0

    def text(self) -> str:
        """Return the payload as text."""
        return self.payload.decode("utf-8", "replace")

    def json(self) -> Mapping[str, Any]:
        """Return the payload as a JSON object; empty if the payload is not a JSON object."""
        try:
            content = parsed(self.payload, "record")
        except ValueRefused:
            return {}
        return content if isinstance(content, dict) else {}


def event_payload(kind: str, facts: Mapping[str, Any]) -> bytes:
    """Return the payload of an event. Facts that JSON cannot store become text, so that no event is lost."""
    try:
        text = json_text({"kind": kind, "facts": facts})
    except (TypeError, ValueError):
        text = json_text({"kind": kind, "facts": {name: repr(value) for name, value in facts.items()}})
    return text.encode("ascii")


def frame(kind: Kind, payload: bytes, sequence: int, mono_ns: int, log: int, channel: int = 0, parts: int = 0) -> bytes:
    """Return one record with a payload of at most 65535 bytes.

    Examples
    --------
    >>> frame(Kind.DATA, b"R0500", sequence=7, mono_ns=1, log=2, channel=3).hex(" ", -4)
    'f5a90500 07000000 01000000 00000000 02000000 02030000 034438e3 52303530 30'
    """
    head = _HEAD.pack(MAGIC, len(payload), sequence % _WRAP, mono_ns, log, kind, channel, parts)
    return head + _CRC.pack(zlib.crc32(payload, zlib.crc32(head))) + payload


def frames(kind: Kind, payload: bytes, *, sequence: int, mono_ns: int, log: int, channel: int = 0) -> Iterator[bytes]:
    """Return the records of a payload of any length, numbered from ``sequence``."""
    starts = range(0, max(1, len(payload)), MAX_PAYLOAD)
    for number, start in enumerate(starts):
        parts = (Parts.GOES_ON if number < len(starts) - 1 else 0) | (Parts.GOES_ON_FROM if number else 0)
        piece = payload[start : start + MAX_PAYLOAD]
        yield frame(
            kind, piece, sequence=sequence + number, mono_ns=mono_ns, log=log, channel=channel, parts=int(parts)
        )


def ends_item(record: bytes) -> bool:
    """Return whether a record is the last one of an item: neither a part that continues nor a copy of the header.

    Examples
    --------
    >>> [ends_item(record) for record in frames(Kind.DATA, bytes(70_000), sequence=0, mono_ns=0, log=1)]
    [False, True]
    """
    *_, kind, _, parts = _HEAD.unpack_from(record)
    return kind != Kind.HEADER and not parts & Parts.GOES_ON


Unframed = tuple[int, int, int, Kind, int, int, bytes]


def unframe(data: bytes, at: int, log: int | None) -> Unframed | None:
    """Return the record that begins at an index; None if there is no complete and valid record.

    Parameters
    ----------
    data : bytes
    at : int
        Index of the record's first byte.
    log : int or None
        Number of the log to which the record must belong; None for any log.

    Returns
    -------
    tuple
        sequence, mono_ns, log, kind, channel, parts, payload.
    """
    start = at + HEAD_BYTES
    if start > len(data):
        return None
    magic, length, sequence, mono_ns, log_number, code, channel, parts, crc = _HEAD_AND_CRC.unpack_from(data, at)
    # Cheap checks first, because a search through damaged bytes calls this for every accidental magic.
    kind = _KINDS.get(code)
    if magic != MAGIC or kind is None or parts > _ALL_PARTS or start + length > len(data):
        return None
    if (log is not None and log_number != log) or not 0 <= mono_ns <= LATEST_NS:
        return None
    payload = data[start : start + length]
    if crc != zlib.crc32(payload, zlib.crc32(data[at : at + _HEAD.size])):
        return None
    return sequence, mono_ns, log_number, kind, channel, parts, payload
