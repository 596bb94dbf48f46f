"""Define the layout of a run file: names, types, units and attributes.

docs/reference/run-file.md has the same as a table. The root has hard links to the signal's arrays, for tools that read
only the root. Texts have a fixed length, as in files of the netCDF library: xarray, netCDF4 and NeXus tools return
them as text, h5py returns ``bytes``.

The file states all metadata twice. ``/entry/provenance/header`` is one canonical JSON text (sorted keys, ASCII) of
everything except the arrays. It includes the SHA-256 of every array's decoded little-endian values; the SHA-256 of
the text is stored as an attribute. :class:`storage.run_file.reading.RunFile` reads only this text and the arrays. The
attributes and fields above are made from it for people and other tools.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.block import Block, Flag
from storage.run_file.header import RunHeader
from storage.schema import json_text, plain

HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
CHUNK = 65536
HEADER = "/entry/provenance/header"
SIGNAL = "/entry/signal"
INSTRUMENT = "/entry/instrument"
WIRE = "/wire"
NO_HOST_NS = -1
"""Value of ``host_mono_ns`` if no host recorded the sample."""


class StoredColumn(NamedTuple):
    """One array of the file with a value for each sample.

    ``field`` is that of a :class:`Block` with the values; ``fill`` stands in blocks that lack an optional column.
    """

    path: str
    dtype: str
    attributes: Mapping[str, Any]
    field: str = ""
    fill: float | int = 0

    @property
    def name(self) -> str:
        """The last part of the path."""
        return self.path.rpartition("/")[2]


_NAN = {"_FillValue": np.float64("nan")}
_ERRORS = {"units": "m", "long_name": "standard deviation of a distance, as the source knows it"}
_QUALITY = {
    "long_name": "why a sample may not be taken at face value",
    "standard_name": "quality_flag",
    "flag_masks": np.array([flag.value for flag in Flag], np.uint8),
    "flag_meanings": " ".join(str(flag.name).lower() for flag in Flag),
}
_VELOCITY = {"units": "m/s", "long_name": "velocity as the recording states it", **_NAN}
_HOST = {"units": "ns", "long_name": "host's monotonic clock at arrival; -1 where no host was there"}
STORED_COLUMNS = (
    StoredColumn(f"{SIGNAL}/time", "<f8", {"units": "s", "long_name": "time since the start of the run"}, "t"),
    StoredColumn(
        f"{SIGNAL}/distance", "<f8", {"units": "m", "long_name": "distance from the sensor", **_NAN}, "distance"
    ),
    StoredColumn(f"{SIGNAL}/distance_errors", "<f4", {**_ERRORS, "_FillValue": np.float32("nan")}),
    StoredColumn(f"{SIGNAL}/quality", "|u1", _QUALITY, "flags"),
    StoredColumn(f"{SIGNAL}/velocity", "<f8", _VELOCITY, "velocity", float("nan")),
    StoredColumn("/raw/host_mono_ns", "<i8", _HOST, "host_ns", NO_HOST_NS),
)
BY_NAME = {column.name: column for column in (*STORED_COLUMNS, StoredColumn("/raw/sequence", "<u4", {}))}
"""The columns of files of all versions."""
CHECKED = tuple(column.name for column in STORED_COLUMNS if column.field)
"""The columns of a block, whose digests are checked when all blocks are read."""

_NOISY = frozenset({"distance", "velocity"})


def filters(path: str) -> Mapping[str, Any]:
    """Return the HDF5 filters of an array. The checksum turns a flipped bit into a read error.

    Every reader can undo them without a plugin. The last digits of distances and velocities are noise: compression
    would save a quarter of their size and triple the time to read them.
    """
    if path.rpartition("/")[2] in _NOISY:
        return {"fletcher32": True}
    return {"shuffle": True, "compression": "gzip", "compression_opts": 1, "fletcher32": True}


def arrays(block: Block, sigma_m: float | None) -> dict[str, NDArray[Any] | None]:
    """Return a block's values by column name; None for a missing column."""
    values = {name: getattr(block, BY_NAME[name].field) for name in CHECKED}
    if sigma_m is not None:
        values["distance_errors"] = np.where(np.isnan(block.distance), np.nan, sigma_m).astype("<f4")
    return values


def attributes(header: RunHeader) -> dict[str, dict[str, Any]]:
    """Return the attributes for other tools, by the path of their group or array."""
    info = header.info
    texts = {name: getattr(header, name) for name in ("title", "channel", "format")}
    plot: dict[str, Any] = {"NX_class": "NXdata", "signal": "distance", "axes": ("time",)}
    if "velocity" in header.columns:
        plot["auxiliary_signals"] = ("velocity",)
    tree: dict[str, dict[str, Any]] = {
        "/": {"Conventions": "CF-1.11", "NX_class": "NXroot", "default": "entry", "kind": info.kind},
        "/entry": {"NX_class": "NXentry", "default": "signal"},
        SIGNAL: {"kind": info.kind} | {name: text for name, text in texts.items() if text} | plot,
        INSTRUMENT: {"NX_class": "NXinstrument"},
        "/entry/provenance": {"NX_class": "NXprocess", **_provenance(header)},
        "/raw": {"NX_class": "NXcollection"},
    }
    if header.scene is not None:
        tree["/entry/scene"] = {"NX_class": "NXcollection", "json": json_text(header.scene)}
    if header.originals:
        names = tuple(entry.name for entry in header.originals)
        tree[WIRE] = {"NX_class": "NXcollection", "content": "files", "record_name": names}
    tree |= {BY_NAME[name].path: _column_attributes(BY_NAME[name], header) for name in header.columns}
    units = {"hz": "Hz", "m": "m"}
    named = {path: units.get(path.rpartition("_")[2]) for path in fields(header)}
    return tree | {path: {"units": unit} for path, unit in named.items() if unit}


def _column_attributes(column: StoredColumn, header: RunHeader) -> dict[str, Any]:
    """Return a column's attributes in this run."""
    attributes = dict(column.attributes)
    if column.name == "time":
        attributes["clock"] = header.info.clock
        attributes["epoch"] = _text(header, "start_time") or "unknown"
        moment = header.provenance.get("decoding", {}).get("clock", {}).get("moment")
        attributes |= {"moment": moment} if moment else {}
    if header.quantity not in ("", "length") and column.attributes.get("units") in ("m", "m/s"):
        attributes["units"] = header.unit if column.attributes["units"] == "m" else f"{header.unit}/s"
    if column.name == "distance":
        if header.quantity:
            attributes["quantity"] = header.quantity
        if header.quantity not in ("", "length"):
            attributes["long_name"] = header.quantity
        beside = ("distance_errors", "quality")
        attributes["ancillary_variables"] = " ".join(name for name in beside if name in header.columns)
    return attributes


def fields(header: RunHeader) -> dict[str, Any]:
    """Return the scalar fields by path: NeXus uses fields for quantities with a unit."""
    values = {"/entry/title": header.title, "/entry/start_time": _text(header, "start_time")}
    values |= {f"{INSTRUMENT}/{name}": value for name, value in plain(header.info).items()}
    filled = {path: value for path, value in values.items() if value not in (None, "")}
    return {path: value if isinstance(value, str) else float(value) for path, value in filled.items()}


def _provenance(header: RunHeader) -> dict[str, Any]:
    attributes: dict[str, Any] = {"malformed_rows": header.malformed_rows}
    texts = {name: _text(header, name) for name in ("software", "version", "created_utc")}
    attributes |= {name: text for name, text in texts.items() if text}
    if "configuration" in header.provenance:
        attributes["configuration"] = json_text(header.provenance["configuration"])
    if header.traps:
        attributes["traps"] = json_text(header.traps)
    if header.originals:
        attributes["original_sha256"] = tuple(entry.sha256 for entry in header.originals)
    return attributes


def _text(header: RunHeader, key: str) -> str:
    """Return a text of the provenance; empty if there is none."""
    value = header.provenance.get(key)
    return value if isinstance(value, str) else ""


def stored(value: Any) -> tuple[Any, Any]:
    """Return a value and its type as HDF5 stores them.

    Texts get a fixed length, as in files of the netCDF library. HDF5 stores texts of variable length in its global
    heap, the only part of the file without a checksum: a flipped bit there changes them unnoticed, or sends the HDF5
    library into an endless loop.
    """
    import h5py

    if not isinstance(value, str | tuple):
        return value, None
    texts = [_shown(text).encode() for text in ((value,) if isinstance(value, str) else value)]
    dtype = h5py.string_dtype(length=max(1, *map(len, texts)))
    return (texts[0] if isinstance(value, str) else np.array(texts, dtype)), dtype


def _shown(text: str) -> str:
    """Return a text as HDF5 can store it, without NUL and lone surrogates; the header has the exact text."""
    return text.replace("\0", "\ufffd").encode("utf-16", "surrogatepass").decode("utf-16", "replace")
