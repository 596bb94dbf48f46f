"""Define the layout of a wire log: the bytes of a record, and the JSON of its header and events.

A log is a sequence of records and nothing else, little-endian::

    offset  size  field
         0     2  magic      F5 A9; F5 occurs in no UTF-8 text
         2     2  length     u16, bytes of payload
         4     4  sequence   u32, number of the record, counted from 0, modulo 2^32
         8     8  mono_ns    i64, ns, host's monotonic clock: time of the read for data, of the event otherwise
        16     4  log        u32, random, the same in every record of a log
        20     1  kind       1 header, 2 data, 3 mark, 4 event, 5 end
        21     1  channel    u8, the sensor; 0 if the record belongs to no sensor
        22     2  parts      u16, 0; logs of 0.2.0 have 1 and 2 where a payload was split
        24     4  crc32      of bytes 0 to 23 and the payload (zlib's polynomial)
        28        payload

``log`` distinguishes the records from those of another log: an old log whose disk blocks reappear after a power cut,
or a log that a device sends as its data. A header is repeated once after 32 KiB, so that no lost page destroys both
copies. Data are the bytes of one read of a port, a mark is UTF-8 text, header, event and end are JSON. Without the end
record, a recording was cut short.
"""

from __future__ import annotations

import enum
import struct
import zlib
from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from typing import Annotated, Any, NamedTuple

from msgspec import Meta, Struct, field

from acquisition.block import SourceKind
from acquisition.errors import CalibrationError
from acquisition.events import Event, StoredEvent
from acquisition.live.calibration import Calibration
from storage.schema import ValueRefused, decoded, json_text, parsed, plain, shown

HIGHEST_CHANNEL = 255
"""Maximum channel number: a record has one byte for it."""
LATEST_NS = 1 << 62
"""Maximum time of a clock, ns: 146 years after the start of the host, or the year 2116 in UTC."""
LOG_VERSION = 1
WIRE_MAGIC = b"\xf5\xa9"
MAX_PAYLOAD = 65535
_HEAD = struct.Struct("<2sHIqIBBH")
_CRC = struct.Struct("<I")
_HEAD_AND_CRC = struct.Struct(_HEAD.format + "I")
RECORD_HEAD_BYTES = _HEAD_AND_CRC.size
LONGEST_RECORD = RECORD_HEAD_BYTES + MAX_PAYLOAD
"""Maximum size of a record, bytes."""
WRAP = 1 << 32
"""Sequence numbers count modulo this."""


class RecordKind(enum.IntEnum):
    """The kind of a record; the values are stored in logs and never change."""

    HEADER = 1
    DATA = 2
    MARK = 3
    EVENT = 4
    END = 5


_KINDS = {kind.value: kind for kind in RecordKind}


class Record(NamedTuple):
    """One record; ``lost_before`` records are missing before it, and no frame may span them."""

    offset: int
    sequence: int
    mono_ns: int
    kind: RecordKind
    channel: int
    payload: bytes
    lost_before: int = 0

    def text(self) -> str:
        """Return the payload as text."""
        return self.payload.decode("utf-8", "replace")


def frame(kind: RecordKind, payload: bytes, sequence: int, mono_ns: int, log: int, channel: int = 0) -> bytes:
    """Return one record with a payload of at most 65535 bytes.

    >>> frame(RecordKind.DATA, b"R0500", sequence=7, mono_ns=1, log=2, channel=3).hex(" ", -4)
    'f5a90500 07000000 01000000 00000000 02000000 02030000 034438e3 52303530 30'
    """
    head = _HEAD.pack(WIRE_MAGIC, len(payload), sequence % WRAP, mono_ns, log, kind, channel, 0)
    return head + _CRC.pack(zlib.crc32(payload, zlib.crc32(head))) + payload


def unframe(data: bytes, at: int, log: int | None) -> tuple[int, int, int, RecordKind, int, bytes] | None:
    """Return the complete and valid record that begins at an index: sequence, mono_ns, log, kind, channel, payload.

    Return None if there is none, or if it belongs to another log than number ``log``.
    """
    start = at + RECORD_HEAD_BYTES
    if start > len(data):
        return None
    magic, length, sequence, mono_ns, number, code, channel, _, crc = _HEAD_AND_CRC.unpack_from(data, at)
    end = start + length
    # Cheap checks first, because a search through damaged bytes calls this for every accidental magic.
    if magic != WIRE_MAGIC or end > len(data) or (number != log and log is not None) or code not in _KINDS:
        return None
    payload = data[start:end]
    if not 0 <= mono_ns <= LATEST_NS or crc != zlib.crc32(payload, zlib.crc32(data[at : at + _HEAD.size])):
        return None
    return sequence, mono_ns, number, _KINDS[code], channel, payload


_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_Nanoseconds = Annotated[int, Meta(ge=0, le=LATEST_NS)]
_Word = Annotated[str, Meta(max_length=100)]
_Option = Annotated[str, Meta(max_length=256)] | Annotated[int, Meta(ge=-(2**53), le=2**53)]


class SensorEntry(Struct, frozen=True, forbid_unknown_fields=True):
    """One sensor of a run: the channel of its records, its family and port, and how its bytes are decoded.

    ``rate_hz`` is the configured number of readings per second, and ``clock_ppm`` the maximum rate error of the
    sensor's clock; None stands for the family's value. ``calibration`` has the numbers of
    :class:`acquisition.live.calibration.Calibration`; it is empty for the default.
    """

    channel: Annotated[int, Meta(ge=0, le=HIGHEST_CHANNEL)]
    family: _Word
    port: Annotated[str, Meta(max_length=4096)] = ""
    baud: Annotated[int, Meta(ge=0, le=10**9)] = 0
    rate_hz: Annotated[float, Meta(ge=1e-6, le=1e9)] | None = None
    options: dict[str, _Option] = field(default_factory=dict)
    clock_ppm: Annotated[float, Meta(ge=0.0, le=1e6)] | None = None
    calibration: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        demand_calibration(self.calibration, "calibration")


class LogHeader(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The description of a run at the start of its log.

    ``mono_ns`` and ``unix_ns`` are the times of the host's monotonic clock and of UTC (since 1970) at the same moment,
    ns. ``kind`` is stored with the data, so that simulated data cannot be mistaken for measured data.
    """

    sensors: Annotated[tuple[SensorEntry, ...], Meta(min_length=1, max_length=256)]
    mono_ns: _Nanoseconds
    unix_ns: _Nanoseconds
    kind: SourceKind = "live"
    scene: Mapping[str, Any] | None = None
    title: Annotated[str, Meta(max_length=10_000)] = ""
    version: _Word = ""

    def __post_init__(self) -> None:
        channels = [sensor.channel for sensor in self.sensors]
        if len(set(channels)) != len(channels):
            raise ValueRefused("sensors", f"expected different channels, got {channels}")

    def utc(self, mono_ns: int) -> str:
        """Convert a time of the monotonic clock in ns to UTC (ISO 8601); empty after the year 9999."""
        micros = (self.unix_ns + mono_ns - self.mono_ns) // 1000
        try:
            return (_EPOCH + timedelta(microseconds=micros)).isoformat(timespec="microseconds")
        except OverflowError:
            return ""

    def encode(self) -> bytes:
        """Return the payload of a header record; raise TypeError or ValueError if :meth:`decode` would refuse it."""
        content = {"log": LOG_VERSION, "start_utc": self.utc(self.mono_ns), **plain(self)}
        payload = json_text(content).encode("ascii")
        if len(payload) > MAX_PAYLOAD:
            raise ValueError(f"expected a header of at most {MAX_PAYLOAD} bytes, got {len(payload)}")
        self.decode(payload)
        return payload

    @classmethod
    def decode(cls, payload: bytes) -> LogHeader:
        """Decode the payload that :meth:`encode` returned; raise ValueRefused for another version or value."""
        content = parsed(payload, "header")
        if isinstance(content, dict):
            if (version := content.pop("log", None)) != LOG_VERSION:
                reason = f"expected {LOG_VERSION}, the version of the layout, got {shown(version)}"
                raise ValueRefused("header.log", reason)
            content.pop("start_utc", None)  # for people; unix_ns states the same time
        return decoded(content, cls, "header")


def demand_calibration(numbers: object, key: str) -> None:
    """Raise ValueRefused if numbers from a log are not those of a calibration."""
    try:
        Calibration.from_mapping(decoded(numbers, dict[str, float], key))
    except CalibrationError as error:
        raise ValueRefused(key, str(error)) from error


def event_payload(event: StoredEvent | Event) -> bytes:
    """Return the payload of an event. Facts that JSON cannot store become text, so that no event is lost."""
    try:
        text = json_text({"kind": event.kind, "facts": event.facts})
    except (TypeError, ValueError):
        text = json_text({"kind": event.kind, "facts": {name: repr(value) for name, value in event.facts.items()}})
    return text.encode("ascii")


def event_of(payload: bytes) -> StoredEvent:
    """Return the event of a record.

    If it cannot be read, its kind is "unreadable", and its facts contain the reason and the record's first bytes.
    """
    try:
        return decoded(parsed(payload, "event"), StoredEvent, "event")
    except ValueRefused as error:
        return StoredEvent("unreadable", {"why": str(error), "bytes": payload[:200].decode("ascii", "replace")})
