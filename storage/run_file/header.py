"""The header of a run file: everything about a run that is not an array, as one canonical JSON text."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from acquisition.block import UNITS
from acquisition.recordings.recording import Trap
from acquisition.source import SourceInfo
from storage.checked import ValueRefused, demand, parsed
from storage.run_file.rules import HEADER_RULE

__all__ = ["SCHEMA", "FileEntry", "Header", "json_text"]

SCHEMA = 1


@dataclass(frozen=True, slots=True)
class FileEntry:
    """An original file's name, length in bytes and SHA-256."""

    name: str
    size: int
    sha256: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Header:
    """Everything about a run that is not an array.

    Parameters
    ----------
    info : SourceInfo
        The source.
    first, samples : int
        Index of the first sample, and how many there are.
    columns : mapping of str to str
        SHA-256 of every column that the file holds, by name.
    originals : tuple of FileEntry
        The original files.
    title, channel, format : str
        As in a recording.
    scene, provenance : mapping or None, mapping
        JSON-able, with string keys.
    traps : tuple of Trap
        What was seen on reading.
    malformed_rows : int
        Rows that were not samples.
    quantity, unit : str
        What the samples are of, as in :class:`acquisition.block.Block`; empty in files from before it was written,
        which hold a length in metres.
    """

    info: SourceInfo
    first: int
    samples: int
    columns: Mapping[str, str]
    originals: tuple[FileEntry, ...] = ()
    title: str = ""
    channel: str = "distance"
    format: str = ""
    scene: Mapping[str, Any] | None = None
    traps: tuple[Trap, ...] = ()
    malformed_rows: int = 0
    provenance: Mapping[str, Any]
    quantity: str = ""
    unit: str = ""

    def encode(self) -> bytes:
        """Return the canonical JSON text.

        Raises
        ------
        TypeError, ValueError
            If the scene or the provenance holds what JSON cannot: an object, NaN, an infinity; or a value is one that
            :meth:`decode` would refuse.
        """
        content = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        text = json_text({"schema": SCHEMA, **content}).encode("ascii")
        self.decode(text)
        return text

    @classmethod
    def decode(cls, text: bytes) -> Header:
        """Read what :meth:`encode` wrote.

        Raises
        ------
        ValueRefused
            If a value is not what :data:`storage.run_file.rules.HEADER_RULE` allows.
        ValueError
            If the text is of another schema.
        """
        content = parsed(text, "header")
        schema = content.pop("schema", None) if isinstance(content, dict) else None
        if schema != SCHEMA:
            raise ValueError(f"schema {SCHEMA} demanded, got {ascii(schema)[:60]}")
        demand(HEADER_RULE, content, "header")
        quantity, unit = content.get("quantity", ""), content.get("unit", "")
        if unit != UNITS.get(quantity, ""):
            raise ValueRefused("header.unit", f"{UNITS.get(quantity, 'empty')} of the quantity {quantity!r}", unit)
        content.pop("implied", None)  # formulas of columns, which some files hold besides the columns
        content["info"] = SourceInfo(**content["info"])
        content["originals"] = tuple(FileEntry(**entry) for entry in content.get("originals", ()))
        content["traps"] = tuple(Trap(**trap) for trap in content.get("traps", ()))
        return cls(**content)


def json_text(value: Any) -> str:
    """Return canonical JSON: sorted keys, no blanks, ASCII; numpy's numbers as plain ones.

    Examples
    --------
    >>> json_text({"b": np.float64(0.5), "a": [1, None]})
    '{"a":[1,null],"b":0.5}'
    """
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False, default=_plain)


def _plain(value: object) -> object:
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, Mapping):
        return dict(value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return dataclasses.asdict(value)
    raise TypeError(f"{value!r} ({type(value).__name__}) is nothing that JSON can hold")
