"""Define the JSON records of a wire log: its header (sensors, clocks, bench) and its events."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from typing import Annotated, Any

from msgspec import Meta, Struct, field

from acquisition.source import Kind as SourceKind
from storage.schema import Calibrated, ValueRefused, decoded, json_text, parsed, plain, shown

__all__ = ["LATEST_NS", "LOG_VERSION", "LONGEST_TEXT", "LogHeader", "SensorEntry", "event_content"]

LOG_VERSION = 1
LONGEST_TEXT = 64 * 65535
"""Maximum size of a header, mark or event, bytes."""
LATEST_NS = 1 << 62
"""Maximum time of a clock, ns: 146 years after the start of the host, or the year 2116 in UTC."""
DEEPEST = 17
"""Maximum depth of nested tables and lists, including the header or event itself."""

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_Nanoseconds = Annotated[int, Meta(ge=0, le=LATEST_NS)]
_Word = Annotated[str, Meta(max_length=100)]
_Option = Annotated[str, Meta(max_length=256)] | Annotated[int, Meta(ge=-(2**53), le=2**53)]


class SensorEntry(Calibrated, frozen=True, forbid_unknown_fields=True):
    """One sensor of a run.

    Parameters
    ----------
    channel : int
        Number of the sensor within the run.
    family : str
        Name of the sensor family.
    port : str
        Address of the port.
    baud : int
    rate_hz : float or None
        Configured number of readings per second, Hz; None for the family's rate.
    options : mapping
        Options of the family's decoder.
    calibration : mapping
        Numbers of :class:`acquisition.live.calibration.Calibration` by name; empty for the default.
    clock_ppm : float or None
        Maximum rate error of the sensor's clock, ppm; None for the value of the family.
    """

    channel: Annotated[int, Meta(ge=0, le=255)]
    family: _Word
    port: Annotated[str, Meta(max_length=4096)] = ""
    baud: Annotated[int, Meta(ge=0, le=10**9)] = 0
    rate_hz: Annotated[float, Meta(ge=1e-6, le=1e9)] | None = None
    options: dict[str, _Option] = field(default_factory=dict)
    clock_ppm: Annotated[float, Meta(ge=0.0, le=1e6)] | None = None


class LogHeader(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The description of a run at the start of its log.

    Parameters
    ----------
    sensors : tuple of SensorEntry
        The sensors, each with a different channel.
    mono_ns, unix_ns : int
        Times of the host's monotonic clock and of UTC (since 1970) at the same moment, ns; they map one clock to the
        other.
    kind : {"live", "simulated", "replay"}
        Kind of source. It is stored with the data, so that simulated data cannot be mistaken for measured data.
    scene : mapping or None
        The scene's tables, which JSON must be able to store.
    title, version : str
        The run's title, and the version of springmass that records it.
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
        """Return the payload of a header record.

        Raises
        ------
        TypeError, ValueError
            If JSON cannot store the scene or an option, or :meth:`decode` would refuse a value.
        """
        content = {"log": LOG_VERSION, "start_utc": self.utc(self.mono_ns), **plain(self)}
        payload = json_text(content).encode("ascii")
        if len(payload) > LONGEST_TEXT:
            raise ValueError(f"expected a header of at most {LONGEST_TEXT} bytes, got {len(payload)}")
        self.decode(payload)
        return payload

    @classmethod
    def decode(cls, payload: bytes) -> LogHeader:
        """Decode the payload that :meth:`encode` returned.

        Raises
        ------
        storage.schema.ValueRefused
            If a value is not allowed for its key, or the log has another version.
        """
        content = parsed(payload, "header")
        if isinstance(content, dict):
            if (version := content.pop("log", None)) != LOG_VERSION:
                reason = f"expected {LOG_VERSION}, the version of the layout, got {shown(version)}"
                raise ValueRefused("header.log", reason)
            content.pop("start_utc", None)  # for people; unix_ns states the same time
        return decoded(content, cls, "header", DEEPEST)


class _Event(Struct, frozen=True, forbid_unknown_fields=True):
    kind: _Word
    facts: dict[str, Any] = field(default_factory=dict)


def event_content(payload: bytes) -> dict[str, Any]:
    """Return the kind and the facts of an event record.

    If they cannot be read, the kind is "unreadable", and the facts contain the reason and the record's first bytes.
    """
    try:
        return plain(decoded(parsed(payload, "event"), _Event, "event", DEEPEST))
    except ValueRefused as error:
        return {"kind": "unreadable", "facts": {"why": str(error), "bytes": payload[:200].decode("ascii", "replace")}}
