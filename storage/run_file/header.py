"""Define the header of a run file: everything except the arrays, as one canonical JSON text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from msgspec import Meta, Struct

from acquisition.block import UNITS, ClockKind, SourceKind
from storage.schema import Count, ValueRefused, decoded, json_text, parsed, plain, shown

RUN_SCHEMA = 1

_Text = Annotated[str, Meta(max_length=1 << 20)]
_Sha256 = Annotated[str, Meta(pattern=r"^[0-9a-f]{64}\Z")]
_Samples = Annotated[int, Meta(ge=0, le=2**32)]
_Length = Annotated[float, Meta(ge=0.0, le=1e30)]


class Info(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The source, as :class:`acquisition.block.SourceInfo` describes it."""

    kind: SourceKind
    name: _Text
    rate_hz: Annotated[float, Meta(ge=1e-9, le=1e12)]
    sigma_m: _Length | None = None
    quantum_m: _Length | None = None
    clock: ClockKind = "nominal"
    stated_error_m: Annotated[float, Meta(ge=-1e30, le=1e30)] | None = None  # as printed in a recording
    u_rate: _Length | None = None
    misplaced_s: _Length | None = None


class FileEntry(Struct, frozen=True, forbid_unknown_fields=True):
    """An original file's name, length in bytes and SHA-256."""

    name: _Text
    size: Annotated[int, Meta(ge=0, le=2**48)]
    sha256: _Sha256


class TrapEntry(Struct, frozen=True, forbid_unknown_fields=True):
    """A remark of the reader, as described by :class:`acquisition.recordings.recording.FormatIssue`."""

    code: Annotated[str, Meta(max_length=200)]
    message: _Text
    count: Count = 1
    line: Count | None = None


class RunHeader(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Everything about a run that is not an array.

    ``first`` is the index of the first sample. ``columns`` has the SHA-256 of every column in the file. ``quantity``
    and ``unit`` are those of :class:`acquisition.block.Block`; they are empty in older files, which contain lengths.
    """

    info: Info
    first: _Samples
    samples: _Samples
    columns: Mapping[str, _Sha256]
    provenance: Mapping[str, Any]
    originals: tuple[FileEntry, ...] = ()
    title: _Text = ""
    channel: _Text = "distance"
    format: _Text = ""
    scene: Mapping[str, Any] | None = None
    traps: tuple[TrapEntry, ...] = ()
    malformed_rows: Count = 0
    quantity: str = ""
    unit: str = ""

    def encode(self) -> bytes:
        """Return the canonical JSON text; raise TypeError or ValueError if :meth:`decode` would refuse it."""
        text = json_text({"schema": RUN_SCHEMA, **plain(self)}).encode("ascii")
        self.decode(text)
        return text

    @classmethod
    def decode(cls, text: bytes) -> RunHeader:
        """Decode the text that :meth:`encode` returned.

        Raises ValueRefused if a value is not allowed for its key, and ValueError if the text has another schema.
        """
        content = parsed(text, "header")
        schema = content.pop("schema", None) if isinstance(content, dict) else None
        if schema != RUN_SCHEMA:
            raise ValueError(f"expected schema {RUN_SCHEMA}, got {shown(schema)}")
        content.pop("implied", None)  # formulas of columns, which some older files have
        header = decoded(content, cls, "header")
        if missing := [name for name in ("time", "distance", "quality") if name not in header.columns]:
            raise ValueRefused("header.columns", f"expected also {missing[0]}")
        if (header.quantity, header.unit) not in {("", ""), *UNITS.items()}:
            allowed = ", ".join(f"{quantity} in {unit}" for quantity, unit in UNITS.items())
            got = f"{shown(header.quantity)} in {shown(header.unit)}"
            raise ValueRefused("header.quantity", f"expected one of {allowed}, got {got}")
        return header
