"""The header of a wire log: the sensors, the clocks and the bench, before the first byte came."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Any

from acquisition.source import Kind as SourceKind
from storage.run_file.header import json_text
from storage.wire_log.allowed import LOG_VERSION, LONGEST_TEXT, header_content

__all__ = ["LogHeader", "SensorEntry"]

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


@dataclass(frozen=True, slots=True)
class SensorEntry:
    """One sensor of a run.

    Parameters
    ----------
    channel : int
        0 to 255, its number within the run.
    family : str
        As ``--sensor`` took it.
    port : str
        Address of the port.
    baud : int
    rate_hz : float or None
        Readings per second that it is set to, Hz; None for the family's.
    options : mapping
        Of the family's decoder; JSON-able.
    calibration : mapping
        Numbers of :class:`acquisition.live.calibration.Calibration` by name; empty for the default.
    clock_ppm : float or None
        What its clock may be off at most, ppm; None for the family's.
    """

    channel: int
    family: str
    port: str = ""
    baud: int = 0
    rate_hz: float | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    calibration: Mapping[str, Any] = field(default_factory=dict)
    clock_ppm: float | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.channel <= 255:
            raise ValueError(f"a channel must lie in 0 to 255, got {self.channel}")


@dataclass(frozen=True, slots=True, kw_only=True)
class LogHeader:
    """What a log says of its run before the first byte came.

    Parameters
    ----------
    sensors : tuple of SensorEntry
        Each with a channel of its own.
    mono_ns, unix_ns : int
        The host's monotonic clock and UTC since 1970 at one and the same moment, ns: the map between the two.
    kind : {"live", "simulated", "replay"}
        Travels with the data: simulated data cannot pass for measured.
    scene : mapping or None
        The scene's tables; JSON-able.
    title, version : str
        The run's title; the version of springmass that records it.
    """

    sensors: tuple[SensorEntry, ...]
    mono_ns: int
    unix_ns: int
    kind: SourceKind = "live"
    scene: Mapping[str, Any] | None = None
    title: str = ""
    version: str = ""

    def __post_init__(self) -> None:
        channels = [sensor.channel for sensor in self.sensors]
        if len(set(channels)) != len(channels):
            raise ValueError(f"each sensor must have a channel of its own, got {channels}")
        if self.kind not in ("live", "simulated", "replay"):
            raise ValueError(f"kind must be live, simulated or replay, got {self.kind!r}")

    def utc(self, mono_ns: int) -> str:
        """Return the wall clock (ISO 8601, UTC) at a moment of the monotonic clock in ns; empty beyond year 9999."""
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
            If the scene or an option holds what JSON cannot, or a key what :meth:`decode` would refuse.
        """
        content = {item.name: getattr(self, item.name) for item in dataclasses.fields(self)}
        payload = json_text({"log": LOG_VERSION, "start_utc": self.utc(self.mono_ns), **content}).encode("ascii")
        if len(payload) > LONGEST_TEXT:
            raise ValueError(f"a header of at most {LONGEST_TEXT} bytes was demanded, got {len(payload)}")
        self.decode(payload)
        return payload

    @classmethod
    def decode(cls, payload: bytes) -> LogHeader:
        """Read what :meth:`encode` wrote.

        Raises
        ------
        storage.checked.ValueRefused
            If a key holds what it may not (:mod:`storage.wire_log.allowed`), or the log is of another version.
        """
        content = header_content(payload)
        del content["log"]
        content.pop("start_utc", None)  # for people; the clock map says the same
        content["sensors"] = tuple(SensorEntry(**sensor) for sensor in content["sensors"])
        return cls(**content)
