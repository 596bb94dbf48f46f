"""Define the header of a run file: everything except the arrays, as one canonical JSON text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from msgspec import Meta, Struct, field

from acquisition.block import UNITS
from acquisition.source import ClockKind, Kind
from storage.schema import Calibrated, Count, ValueRefused, converted, decoded, json_text, parsed, plain, shown

__all__ = ["LONGEST_HEADER", "MOST_UNWRITTEN", "SCHEMA", "FileEntry", "Header", "Info", "TrapEntry"]

SCHEMA = 1
LONGEST_HEADER = 1 << 26
"""Maximum size of the header's text, bytes; a day of events needs a thousandth of this."""
MOST_UNWRITTEN = 10_000_000
"""Number of samples that is always accepted: a day at 100 Hz. For bytes of original files the limit is 64 times higher.

A larger number of samples must not exceed the size of the file in bytes. Otherwise a small file could fill the memory
(a decompression bomb).
"""
DEEPEST = 33
"""Maximum depth of nested tables and lists, including the header itself."""

_Text = Annotated[str, Meta(max_length=1 << 20)]
_Word = Annotated[str, Meta(max_length=200)]
_Sha256 = Annotated[str, Meta(pattern=r"^[0-9a-f]{64}\Z")]
_Samples = Annotated[int, Meta(ge=0, le=2**32)]
_Length = Annotated[float, Meta(ge=0.0, le=1e30)]
_Positive = Annotated[float, Meta(ge=0.0, le=1e300)]


class Info(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The source, as :class:`acquisition.source.SourceInfo` describes it."""

    kind: Kind
    name: _Text
    rate_hz: Annotated[float, Meta(ge=1e-9, le=1e12)]
    sigma_m: _Length | None = None
    quantum_m: _Length | None = None
    clock: ClockKind = "nominal"
    stated_error_m: Annotated[float, Meta(ge=-1e30, le=1e30)] | None = None  # as printed in a recording


class FileEntry(Struct, frozen=True, forbid_unknown_fields=True):
    """An original file's name, length in bytes and SHA-256."""

    name: _Text
    size: Annotated[int, Meta(ge=0, le=2**48)]
    sha256: _Sha256


class TrapEntry(Struct, frozen=True, forbid_unknown_fields=True):
    """A remark of the reader, as described by :class:`acquisition.recordings.recording.Trap`."""

    code: _Word
    message: _Text
    count: Count = 1
    line: Count | None = None


class _Columns(Struct, frozen=True, forbid_unknown_fields=True):
    time: _Sha256
    distance: _Sha256
    quality: _Sha256
    distance_errors: _Sha256 = ""
    velocity: _Sha256 = ""
    sequence: _Sha256 = ""
    host_mono_ns: _Sha256 = ""


class _SensorNote(Calibrated, frozen=True):
    family: _Text = ""
    options: dict[str, Any] = field(default_factory=dict)


class _ClockNote(Struct, frozen=True):
    rate_error_ppm: Annotated[float, Meta(ge=-1e300, le=1e300)] | None = None
    u_rate_error_ppm: _Positive | None = None
    limit_ppm: _Positive = 0.0
    span_s: _Positive = 0.0
    held_readings: Count = 0
    longest_stall_s: _Positive = 0.0
    moment: Literal["reflection", "reading"] = "reading"


class _DecodingNote(Struct, frozen=True):
    clock: _ClockNote = _ClockNote()


class _Provenance(Struct, frozen=True):
    """The entries of the provenance that other code reads; further ones are allowed."""

    sensor: _SensorNote = _SensorNote()
    start_time: _Word | None = None
    decoding: _DecodingNote = _DecodingNote()


class Header(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Everything about a run that is not an array.

    Parameters
    ----------
    info : Info
        The source.
    first, samples : int
        Index of the first sample, and the number of samples.
    columns : mapping of str to str
        SHA-256 of every column in the file, by name.
    originals : tuple of FileEntry
        The original files.
    title, channel, format : str
        Title, measured quantity and format family, as in a recording.
    scene, provenance : mapping or None, mapping
        Tables that JSON can store, with string keys.
    traps : tuple of TrapEntry
        Remarks of the reader.
    malformed_rows : int
        Number of rows that were not samples.
    quantity, unit : str
        Quantity and unit of the samples, as in :class:`acquisition.block.Block`. Empty in older files, which contain
        lengths in metres.
    """

    info: Info
    first: _Samples
    samples: _Samples
    columns: Mapping[str, str]
    provenance: Mapping[str, Any]
    originals: Annotated[tuple[FileEntry, ...], Meta(max_length=100_000)] = ()
    title: _Text = ""
    channel: _Text = "distance"
    format: _Text = ""
    scene: Mapping[str, Any] | None = None
    traps: Annotated[tuple[TrapEntry, ...], Meta(max_length=1_000_000)] = ()
    malformed_rows: Count = 0
    quantity: str = ""
    unit: str = ""

    def encode(self) -> bytes:
        """Return the canonical JSON text.

        Raises
        ------
        TypeError, ValueError
            If JSON cannot store a value of the scene or the provenance (an object, NaN, an infinity), or
            :meth:`decode` would refuse it.
        """
        text = json_text({"schema": SCHEMA, **plain(self)}).encode("ascii")
        self.decode(text)
        return text

    @classmethod
    def decode(cls, text: bytes) -> Header:
        """Decode the text that :meth:`encode` returned.

        Raises
        ------
        storage.schema.ValueRefused
            If a value is not allowed for its key.
        ValueError
            If the text has another schema.
        """
        content = parsed(text, "header")
        schema = content.pop("schema", None) if isinstance(content, dict) else None
        if schema != SCHEMA:
            raise ValueError(f"expected schema {SCHEMA}, got {shown(schema)}")
        content.pop("implied", None)  # formulas of columns, which some older files have
        header = decoded(content, cls, "header", DEEPEST)
        converted(header.columns, _Columns, "header.columns")
        read = {name: header.provenance[name] for name in _Provenance.__struct_fields__ if name in header.provenance}
        converted(read, _Provenance, "header.provenance")
        if (header.quantity, header.unit) not in {("", ""), *UNITS.items()}:
            known = ", ".join(f"{quantity} in {unit}" for quantity, unit in UNITS.items())
            got = f"{shown(header.quantity)} in {shown(header.unit)}"
            raise ValueRefused("header.quantity", f"expected one of {known}, got {got}")
        return header
