"""Which families of rangefinders there are, and which one some bytes look like.

The table holds names only: a family's module is imported when it is asked for. A package elsewhere adds one with an
entry point in the group ``springmass.sensors`` that names a :class:`acquisition.decoders.family.Family`.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from typing import TYPE_CHECKING, Any, cast

from acquisition.decoders.family import Family
from acquisition.errors import SensorError
from acquisition.extensions import entry_points_of, load_entry

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

__all__ = ["describe_bytes", "families", "get_family", "probe"]

GROUP = "springmass.sensors"

_TABLE: dict[str, tuple[str, str]] = {
    "line-protocol": ("acquisition.decoders.line_protocol", "FAMILY"),
    "maxbotix-lv": ("acquisition.decoders.maxbotix", "FAMILIES"),
    "maxbotix-lv-p": ("acquisition.decoders.maxbotix", "FAMILIES"),
    "maxbotix-xl": ("acquisition.decoders.maxbotix", "FAMILIES"),
    "maxbotix-xl-long": ("acquisition.decoders.maxbotix", "FAMILIES"),
    "maxbotix-hr": ("acquisition.decoders.maxbotix", "FAMILIES"),
    "maxbotix-wr": ("acquisition.decoders.maxbotix", "FAMILIES"),
    "ffhls": ("acquisition.decoders.ffhls", "FAMILY"),
    "us100": ("acquisition.decoders.us100", "FAMILY"),
    "urm37": ("acquisition.decoders.urm37", "FAMILY"),
    "sen0149": ("acquisition.decoders.sen0149", "FAMILY"),
    "text-lines": ("acquisition.decoders.text_lines", "FAMILY"),
}

_ENOUGH = 0.5
"""Share of the bytes that must be in sound frames before a family is named."""


def families() -> tuple[Family, ...]:
    """Return every family, those of this package first.

    Examples
    --------
    >>> families()[0].name
    'line-protocol'
    """
    added = [_load(entry) for name, entry in _entry_points().items() if name not in _TABLE]
    return (*map(_built_in, _TABLE), *added)


def get_family(name: str) -> Family:
    """Return the family of that name.

    Raises
    ------
    SensorError
        If there is none, or the package that brings it is broken.
    """
    if name in _TABLE:
        return _built_in(name)
    entries = _entry_points()
    if name in entries:
        return _load(entries[name])
    known = ", ".join(dict.fromkeys([*_TABLE, *entries]))
    raise SensorError(f"sensor {name!r} is not known; it must be one of {known}")


def probe(data: bytes) -> list[str]:
    """Tell which families recognise bytes that came off a port, the best first.

    A family is named where at least half of the bytes stand in its sound frames. One without mark or checksum is
    named only where no other is and all of two or more replies are in range.

    Examples
    --------
    >>> probe(bytes.fromhex("ff07a1a7 ff07a2a8"))
    ['ffhls']
    """
    every = families()
    shares = {family.name: _share(family, data) for family in every if family.self_framing}
    named = sorted((name for name, share in shares.items() if share >= _ENOUGH), key=lambda name: -shares[name])
    return named or [family.name for family in every if not family.self_framing and _all_in_range(family, data)]


def describe_bytes(data: bytes) -> str:
    """Return one line for people on what bytes off a port look like.

    Examples
    --------
    >>> describe_bytes(b"")
    'silence'
    >>> describe_bytes(b"Ready.\\r\\nwaiting\\r\\n")
    "looks like text lines without a distance ('Ready.')"
    """
    if not data:
        return "silence"
    names = probe(data)
    if names:
        return "looks like " + " or ".join(f"{get_family(name).title} [{name}]" for name in names)
    if len(set(data)) == 1:
        return f"{len(data)} bytes 0x{data[0]:02X} and no other: a line held at one level, or the wrong baud rate?"
    if _is_text(data):
        return f"looks like text lines without a distance ({_sample(data)!r})"
    return "looks like noise: wrong baud rate, or inverted polarity (RS-232 levels on a TTL adapter)?"


def _share(family: Family, data: bytes) -> float:
    """Return the share of the bytes that stand in sound frames, not counting a first and a last piece of one."""
    decoder = family.decoder()
    readings = decoder.feed(0, data)
    whole = len(data) - decoder.pending
    return 1 - decoder.faults.get("garbage_bytes", 0) / whole if len(readings) else 0.0


def _all_in_range(family: Family, data: bytes) -> bool:
    readings = family.decoder().feed(0, data)
    return len(readings) > 1 and not readings.flags.any()


def _is_text(data: bytes) -> bool:
    return b"\n" in data and sum(byte in b"\t\r\n" or 32 <= byte < 127 for byte in data) >= 0.9 * len(data)


def _sample(data: bytes) -> str:
    """Return the first line that is whole and not empty, shortened."""
    lines: Iterable[str] = data.decode("ascii", "replace").splitlines()
    return next((line.strip()[:40] for line in lines if line.strip()), "")


def _built_in(name: str) -> Family:
    module, attribute = _TABLE[name]
    return _checked(name, getattr(import_module(module), attribute))


def _checked(name: str, found: Any) -> Family:
    """Take a family, or the one of that name from a table of several."""
    family = found.get(name) if isinstance(found, dict) else found
    if not isinstance(family, Family):
        raise SensorError(f"sensor {name!r}: expected a Family, got {type(family).__name__}; repair the package")
    return family


def _entry_points() -> dict[str, EntryPoint]:
    return entry_points_of(GROUP)


def _load(entry: EntryPoint) -> Family:
    found = load_entry(entry, f"sensor {entry.name!r}", SensorError, lambda found: _checked(entry.name, found))
    return cast(Family, found)
