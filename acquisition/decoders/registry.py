"""The registry of the families of rangefinders, and the recognition of a family by its bytes.

The table contains only names; the module of a family is imported on demand. Another package can add a family with an
entry point in the group ``springmass.sensors`` that refers to a :class:`acquisition.decoders.sensor.Sensor`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from acquisition.decoders.decoder import Guess
from acquisition.decoders.sensor import Sensor
from acquisition.errors import SensorError
from failure.extensions import load_named, names_in

if TYPE_CHECKING:
    from collections.abc import Mapping

SENSORS_GROUP = "springmass.sensors"

_MODULES = {
    "line-protocol": "line_protocol",
    **dict.fromkeys([f"maxbotix-{model}" for model in ("lv", "lv-p", "xl", "xl-long", "hr", "wr")], "maxbotix"),
    "ffhls": "summed",
    "us100": "us100",
    "urm37": "summed",
    "sen0149": "summed",
    "tfmini": "lidar",
    "text-lines": "text_lines",
}
"""The module of each family in this package; it has the object FAMILY, or FAMILIES by name."""

_ENOUGH = 0.5
"""Minimum fraction of bytes in valid frames for a family to be recognised."""


def families() -> tuple[Sensor, ...]:
    """Return all families, with those of this package first."""
    return tuple(map(get_family, names_in(SENSORS_GROUP, _MODULES)))


def get_family(name: str) -> Sensor:
    """Return the family with a given name; the SensorError of an unknown name lists the known ones."""
    if name in _MODULES:
        module = import_module(f"acquisition.decoders.{_MODULES[name]}")
        family: Sensor = module.FAMILIES[name] if hasattr(module, "FAMILIES") else module.FAMILY
    elif name in (names := names_in(SENSORS_GROUP, _MODULES)):
        family = load_named(SENSORS_GROUP, name, Sensor, SensorError)
    else:
        raise SensorError(f"sensor must be one of {', '.join(names)}, got {name!r}")
    return family


def probe(data: bytes) -> list[str]:
    """Return the names of the families that recognise bytes from a port, best match first.

    A family recognises bytes if at least half of them are in valid frames. A family without marker or checksum is
    returned only if no other family is recognised, and the bytes give at least two replies, all in range.
    """
    all_families = families()
    shares = {family.name: _share(family, data) for family in all_families if family.self_framing}
    recognised = sorted((name for name, share in shares.items() if share >= _ENOUGH), key=lambda name: -shares[name])
    others = (family for family in all_families if not family.self_framing)
    return recognised or [
        family.name
        for family in others
        if len(readings := family.decoder().feed(0, data)) > 1 and not readings.flags.any()
    ]


def describe_bytes(data: bytes, unread: Mapping[str, Any] | None = None) -> Guess:
    """Return what bytes from a port look like, and which options would read them.

    ``unread`` are the options with which ``text-lines`` found no distance in the bytes.
    """
    if not data:
        return Guess("silence")
    if names := [name for name in probe(data) if unread is None or name != "text-lines"]:
        return Guess("looks like " + " or ".join(f"{get_family(name).title} [{name}]" for name in names))
    if len(set(data)) == 1:
        return Guess(f"{len(data)} bytes, all 0x{data[0]:02X}: a line held at one level, or the wrong baud rate?")
    if is_text(data) and any(end in data for end in (b"\n", b"\r", b"*/", b"\x03")):
        return get_family("text-lines").decoder(**(unread or {})).unread(data)
    if is_text(data):
        start = data[:40].decode("ascii", "replace")
        return Guess(f"looks like text without line ends ({start!r}): let the sketch use println")
    low = bytes(byte & 0x7F for byte in data)
    if is_text(low) and b"\n" in low:
        odd = sum(byte.bit_count() % 2 for byte in data) / len(data)
        form = "7E1" if odd < 0.02 else "7O1" if odd > 0.98 else "7M1" if min(data) > 127 else ""
        if form:
            return Guess("looks like text lines of 7 data bits and a parity", ({"framing": form},))
    if (size := _frame_size(data)) is not None:
        return Guess(f"looks like frames of {size} bytes of an unknown sensor")
    return Guess("looks like noise: wrong baud rate, or inverted polarity (RS-232 levels on a TTL adapter)?")


def is_text(data: bytes) -> bool:
    """Return whether nearly all bytes are printable characters, ends of lines and frames, and colours of a terminal."""
    return sum(byte in b"\x02\x03\t\r\n\x1b" or 32 <= byte < 127 for byte in data) >= 0.9 * len(data)


def _frame_size(data: bytes) -> int | None:
    """Return the distance after which one byte repeats in nearly all frames of at most 32 bytes; None if none does.

    In noise each of 256 values has the probability 1/256, so ten frames in which one is the same nine times are none.
    """
    for size in range(3, 33):
        columns = [data[at::size] for at in range(size)] if len(data) >= 10 * size else []
        if any(max(map(column.count, set(column))) >= 0.9 * len(column) for column in columns):
            return size
    return None


def _share(family: Sensor, data: bytes) -> float:
    """Return the fraction of bytes in valid frames; an incomplete frame at the end is not counted."""
    decoder = family.decoder()
    readings = decoder.feed(0, data)
    whole = len(data) - decoder.pending
    return 1 - decoder.faults.get("garbage_bytes", 0) / whole if len(readings) else 0.0
