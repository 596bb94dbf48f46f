"""What a wire log may say in words: each key of its header and of its events, with type and range."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from storage.calibration import CALIBRATION_RULE
from storage.checked import Choice, Json, Number, Optional, Rows, Table, Text, ValueRefused, demand, parsed

__all__ = ["LATEST_NS", "LOG_VERSION", "LONGEST_TEXT", "demand_calibration", "event_content", "header_content"]

LOG_VERSION = 1
LONGEST_TEXT = 64 * 65535
"""Bytes of the longest header, mark or event."""
LATEST_NS = 1 << 62
"""A host's clock that counts from its start never comes there in 146 years, and UTC in 2116."""

_NS = Number(0, LATEST_NS, whole=True)
_SENSOR = Table(
    keys={"channel": Number(0, 255, whole=True), "family": Text(100)},
    may={
        "port": Text(4096),
        "baud": Number(0, 1e9, whole=True),
        "rate_hz": Optional(Number(1e-6, 1e9)),
        "options": Table(other=Json(1)),
        "calibration": CALIBRATION_RULE,
        "clock_ppm": Optional(Number(0.0, 1e6)),
    },
)
_HEADER = Table(
    keys={
        "log": Number(LOG_VERSION, LOG_VERSION, whole=True),
        "sensors": Rows(_SENSOR, 256),
        "mono_ns": _NS,
        "unix_ns": _NS,
    },
    may={
        "start_utc": Text(100),
        "kind": Choice(("live", "simulated", "replay")),
        "scene": Optional(Table(other=Json(16))),
        "title": Text(10_000),
        "version": Text(100),
    },
)
_EVENT = Table(keys={"kind": Text(100)}, may={"facts": Table(other=Json(16))})
_TEXT, _WHOLE = Text(256), Number(-(2**53), 2**53, whole=True)


def header_content(payload: bytes) -> dict[str, Any]:
    """Return what a header record holds.

    Raises
    ------
    ValueRefused
        For the first key that holds what it may not.
    """
    content = parsed(payload, "header")
    if isinstance(content, dict) and content.get("log") != LOG_VERSION:
        raise ValueRefused("header.log", f"{LOG_VERSION}, the layout that this version reads", content.get("log"))
    demand(_HEADER, content, "header")
    sensors = content["sensors"]
    for number, sensor in enumerate(sensors):
        for name, value in sensor.get("options", {}).items():
            key = f"header.sensors[{number}].options.{name[:60]}"
            demand(_TEXT if isinstance(value, str) else _WHOLE, value, key)
    channels = [sensor["channel"] for sensor in sensors]
    if not channels or len(set(channels)) != len(channels):
        raise ValueRefused("header.sensors", "at least one, each with a channel of its own", channels)
    return dict(content)


def event_content(payload: bytes) -> dict[str, Any]:
    """Return what an event record holds: its kind and its facts.

    One that holds no such thing is an event of the kind "unreadable", with the beginning of its bytes.
    """
    try:
        content = parsed(payload, "event")
        demand(_EVENT, content, "event")
    except ValueRefused as error:
        return {"kind": "unreadable", "facts": {"why": str(error), "bytes": payload[:200].decode("ascii", "replace")}}
    return {"kind": content["kind"], "facts": content.get("facts", {})}


def demand_calibration(facts: Mapping[str, Any]) -> None:
    """Refuse numbers that no calibration has.

    Raises
    ------
    ValueRefused
    """
    demand(CALIBRATION_RULE, facts, "calibration event")
