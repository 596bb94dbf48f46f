"""The run file's layout: names, types, units and attributes, in one place.

::

    /                     @Conventions @NX_class=NXroot @default=entry @kind; second names of the signal's arrays, for
                          tools that look at the root alone (files from before there were any have none)
    /entry                NXentry @default=signal; title, start_time where known
    /entry/signal         NXdata @signal=distance @axes=[time] @kind; on the dimension ``time``:
        time              f8 s, elapsed; @epoch says when t = 0 was, @clock where the times come from, @moment of what
        distance          f8 m @ancillary_variables @quantity
        distance_errors   f4 m, standard deviation; only where the source knows it, NaN where unmeasured
        quality           u1 @flag_masks @flag_meanings
        velocity          f8 m/s; only where the recording states one
                          (of another quantity than a length: in that unit, and in that unit per second)
    /entry/instrument     name, kind, clock, rate_hz, quantum_m, sigma_m, stated_error_m
    /entry/scene          @json: the scene's tables
    /entry/provenance     @software @version @configuration @traps ...; header, see below
    /raw                  sequence u4 (sample index); host_mono_ns i8 where a host was there
    /wire                 bytes u1; record_offset, record_len, record_mono_ns; one record an original file

Texts have a fixed length, as netCDF's own library writes them: xarray, netCDF4 and NeXus tools give them as
text, h5py as ``bytes``.

The file says everything twice. ``/entry/provenance/header`` is one canonical JSON text (sorted keys, ASCII)
of all that is not an array, with the SHA-256 of every array's decoded little-endian values; its own SHA-256
stands beside it. That text alone is what :class:`storage.run_file.reading.Run` believes. The attributes and fields
above
are drawn from it for people and for other tools, and :meth:`storage.run_file.reading.Run.verify` holds them against it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.block import Block, Flag
from storage.run_file.header import Header
from storage.schema import ValueRefused, json_text, plain

__all__ = [
    "CHUNK",
    "COLUMNS",
    "DIMENSION_ATTRIBUTES",
    "GROUPS",
    "HEADER",
    "INSTRUMENT",
    "MAGIC",
    "SIGNAL",
    "WIRE",
    "Column",
    "arrays",
    "attributes",
    "column_attributes",
    "fields",
    "filters",
    "records",
    "signal_attributes",
    "stored",
]

MAGIC = b"\x89HDF\r\n\x1a\n"
CHUNK = 65536
HEADER = "/entry/provenance/header"
SIGNAL = "/entry/signal"
INSTRUMENT = "/entry/instrument"
WIRE = "/wire"
GROUPS = frozenset({"entry", "raw", "wire"})
"""What stands at the root besides second names of columns."""
DIMENSION_ATTRIBUTES = frozenset({"CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST"})
"""What HDF5 itself puts on arrays that are tied to a dimension."""
NO_HOST_NS = -1
"""Stands in ``host_mono_ns`` and ``record_mono_ns`` where no host saw the sample or record."""

FILTERS: Mapping[str, Any] = {
    "shuffle": True,
    "compression": "gzip",
    "compression_opts": 1,
    "fletcher32": True,
}
"""What every reader can undo without a plugin. The checksum makes a flipped bit an error, not a value."""

UNPACKED: Mapping[str, Any] = {"fletcher32": True}
"""For columns whose last digits are noise: packing saves a quarter of their room and triples the time to read them."""

NOISY = frozenset({"distance", "velocity"})
"""The columns that are kept so."""

LIBVER = ("v110", "v110")
"""HDF5 1.10's file format (2016): the oldest in which all of the file's own bookkeeping carries checksums."""


@dataclass(frozen=True, slots=True)
class Column:
    """One array of the file with a value a sample.

    Parameters
    ----------
    path : str
        Where it stands.
    dtype : str
        Its type, little-endian.
    attributes : mapping
        Units and description. What depends on the run is added by :func:`attributes`.
    fill : float or int
        Value of samples from before an optional column's first value.
    least, greatest : float or int
        Its range, both ends allowed; NaN is, too. The ends lie far beyond any bench: squares and sums of what lies
        between are finite.
    """

    path: str
    dtype: str
    attributes: Mapping[str, Any]
    fill: float | int = 0
    least: float | int = -1e12
    greatest: float | int = 1e12

    def demand_within(self, values: NDArray[Any], start: int) -> None:
        """Hold values of samples from ``start`` on against the range.

        Raises
        ------
        ValueRefused
            Naming the first that lies outside.
        """
        # Of all-NaN the extremes are NaN, which is inside; a warning is given for none of it.
        low, high = np.fmin.reduce(values, initial=self.greatest), np.fmax.reduce(values, initial=self.least)
        if low < self.least or high > self.greatest:
            at = int(np.flatnonzero((values < self.least) | (values > self.greatest))[0])
            reason = f"expected a number from {self.least:g} to {self.greatest:g}, got {values[at].item()!r}"
            raise ValueRefused(f"{self.name} of sample {start + at}", reason)

    @property
    def name(self) -> str:
        """The path's last part."""
        return self.path.rpartition("/")[2]


def _quality() -> dict[str, Any]:
    return {
        "long_name": "why a sample may not be taken at face value",
        "standard_name": "quality_flag",
        "flag_masks": np.array([flag.value for flag in Flag], np.uint8),
        "flag_meanings": " ".join(str(flag.name).lower() for flag in Flag),
    }


_NAN = {"_FillValue": np.float64("nan")}
COLUMNS: tuple[Column, ...] = (
    Column(f"{SIGNAL}/time", "<f8", {"units": "s", "long_name": "time since the start of the run"}),
    Column(f"{SIGNAL}/distance", "<f8", {"units": "m", "long_name": "distance from the sensor", **_NAN}),
    Column(
        f"{SIGNAL}/distance_errors",
        "<f4",
        {
            "units": "m",
            "long_name": "standard deviation of a distance, as the source knows it",
            "_FillValue": np.float32("nan"),
        },
        least=0.0,
        greatest=1e30,
    ),
    Column(f"{SIGNAL}/quality", "|u1", _quality(), least=0, greatest=255),  # also bits of later versions
    Column(
        f"{SIGNAL}/velocity",
        "<f8",
        {"units": "m/s", "long_name": "velocity as the recording states it", **_NAN},
        float("nan"),
    ),
    Column("/raw/sequence", "<u4", {"long_name": "index of the sample within the run"}, least=0, greatest=2**32 - 1),
    Column(
        "/raw/host_mono_ns",
        "<i8",
        {"units": "ns", "long_name": "host's monotonic clock at arrival; -1 where no host was there"},
        NO_HOST_NS,
        least=NO_HOST_NS,
        greatest=2**62,
    ),
)


def filters(path: str) -> Mapping[str, Any]:
    """Return what an array's chunks go through on their way to the disk."""
    return UNPACKED if path.rpartition("/")[2] in NOISY else FILTERS


def arrays(block: Block, sigma_m: float | None) -> dict[str, NDArray[Any] | None]:
    """Return a block's values by column name; None for a column that it lacks.

    Parameters
    ----------
    block : Block
        n samples.
    sigma_m : float or None
        Standard deviation of a distance, m.

    Returns
    -------
    dict
        Arrays of shape (n,), by name.
    """
    errors = None
    if sigma_m is not None:
        errors = np.where(np.isnan(block.distance), np.nan, sigma_m).astype("<f4")
    return {
        "time": block.t,
        "distance": block.distance,
        "distance_errors": errors,
        "quality": block.flags,
        "velocity": block.velocity,
        "sequence": np.arange(block.first, block.first + len(block), dtype=np.int64).astype("<u4"),
        "host_mono_ns": block.host_ns,
    }


def records(sizes: NDArray[np.uint64]) -> dict[str, NDArray[Any]]:
    """Return what stands beside the bytes of original files of these sizes, by name: one record a file."""
    return {
        "record_offset": np.cumsum(sizes, dtype="<u8") - sizes,
        "record_len": sizes,
        "record_mono_ns": np.full(len(sizes), NO_HOST_NS, "<i8"),
    }


def attributes(header: Header) -> dict[str, dict[str, Any]]:
    """Return the attributes that other tools see, by the path of the group or array that carries them."""
    info = header.info
    tree: dict[str, dict[str, Any]] = {
        "/": {"Conventions": "CF-1.11", "NX_class": "NXroot", "default": "entry", "kind": info.kind},
        "/entry": {"NX_class": "NXentry", "default": "signal"},
        SIGNAL: signal_attributes(header) | _plot(header),
        INSTRUMENT: {"NX_class": "NXinstrument"},
        "/entry/provenance": {"NX_class": "NXprocess", **_provenance(header)},
        "/raw": {"NX_class": "NXcollection"},
    }
    if header.scene is not None:
        tree["/entry/scene"] = {"NX_class": "NXcollection", "json": json_text(header.scene)}
    if header.originals:
        names = tuple(entry.name for entry in header.originals)
        tree[WIRE] = {"NX_class": "NXcollection", "content": "files", "record_name": names}
    for column in COLUMNS:
        if column.name in header.columns:
            tree[column.path] = column_attributes(column, header)
    return tree | {path: _units_of(path) for path in fields(header)}


def signal_attributes(header: Header) -> dict[str, Any]:
    """Return what travels with the samples wherever they go."""
    texts = {name: getattr(header, name) for name in ("title", "channel", "format")}
    return {"kind": header.info.kind} | {name: text for name, text in texts.items() if text}


def column_attributes(column: Column, header: Header) -> dict[str, Any]:
    """Return a column's attributes in this run."""
    found = dict(column.attributes)
    if column.name == "time":
        found["clock"] = header.info.clock
        found["epoch"] = _text(header, "start_time") or "unknown"
        moment = header.provenance.get("decoding", {}).get("clock", {}).get("moment")
        found |= {"moment": moment} if moment else {}
    if header.quantity not in ("", "length") and column.attributes.get("units") in ("m", "m/s"):
        found["units"] = header.unit + column.attributes["units"].removeprefix("m")
        found["long_name"] = column.attributes["long_name"].replace("distance from the sensor", header.quantity)
    if column.name == "distance":
        if header.quantity:
            found["quantity"] = header.quantity
        beside = ("distance_errors", "quality")
        found["ancillary_variables"] = " ".join(name for name in beside if name in header.columns)
    return found


def fields(header: Header) -> dict[str, Any]:
    """Return the scalar fields by path: NeXus keeps in fields what it gives a unit."""
    found = {"/entry/title": header.title, "/entry/start_time": _text(header, "start_time")}
    found |= {f"{INSTRUMENT}/{name}": value for name, value in plain(header.info).items()}
    stated = {path: value for path, value in found.items() if value not in (None, "")}
    return {path: value if isinstance(value, str) else float(value) for path, value in stated.items()}


_UNITS = {"hz": "Hz", "m": "m"}
"""By the last part of a field's name."""


def _units_of(path: str) -> dict[str, str]:
    units = _UNITS.get(path.rpartition("_")[2])
    return {"units": units} if units else {}


def _plot(header: Header) -> dict[str, Any]:
    """What a NeXus tool plots unasked."""
    found: dict[str, Any] = {"NX_class": "NXdata", "signal": "distance", "axes": ("time",)}
    if "velocity" in header.columns:
        found["auxiliary_signals"] = ("velocity",)
    return found


def _provenance(header: Header) -> dict[str, Any]:
    found: dict[str, Any] = {"malformed_rows": header.malformed_rows}
    texts = {name: _text(header, name) for name in ("software", "version", "created_utc")}
    found |= {name: text for name, text in texts.items() if text}
    if "configuration" in header.provenance:
        found["configuration"] = json_text(header.provenance["configuration"])
    if header.traps:
        found["traps"] = json_text(header.traps)
    if header.originals:
        found["original_sha256"] = tuple(entry.sha256 for entry in header.originals)
    return found


def _text(header: Header, key: str) -> str:
    """Return a text of the provenance, or an empty one."""
    value = header.provenance.get(key)
    return value if isinstance(value, str) else ""


def stored(value: Any) -> tuple[Any, Any]:
    """Return a value as HDF5 is given it, with its type.

    Texts get a fixed length, as netCDF's own library writes them. Texts of free length would lie in HDF5's
    global heap, the one part of the file without a checksum: a flipped bit there changes them unseen, or
    sends the HDF5 library into an endless loop.
    """
    import h5py

    if not isinstance(value, str | tuple):
        return value, None
    texts = [_shown(text).encode() for text in ((value,) if isinstance(value, str) else value)]
    dtype = h5py.string_dtype(length=max(1, *map(len, texts)))
    return (texts[0] if isinstance(value, str) else np.array(texts, dtype)), dtype


def _shown(text: str) -> str:
    """Return a text as HDF5 can hold it, without NUL and lone surrogates; the header holds the exact one."""
    return text.replace("\0", "\ufffd").encode("utf-16", "surrogatepass").decode("utf-16", "replace")
