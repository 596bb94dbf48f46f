"""Arrays that other programs save: numpy (npy, npz), MATLAB (mat), HDF5 and netCDF.

The times are an array with the name or the unit of a time, or one that rises evenly; arrays of the same length are its
channels. Units are those of the attribute ``units``. Two-dimensional arrays are columns.
"""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from acquisition.errors import FormatError
from acquisition.recordings.tables.format import ColumnFormat
from acquisition.recordings.tables.headings import Heading, heading_of, is_time
from acquisition.recordings.tables.layout import times_by_name, times_by_steps
from acquisition.recordings.tables.table import Column, Header, Table, side_by_side
from acquisition.recordings.tables.text import ZIP_MAGIC
from acquisition.units import time_unit

MOST_ARRAY_BYTES = 1 << 28
"""Maximum size of all arrays of a file, bytes."""
_FEWEST, _MOST_COLUMNS = 3, 32
_HDF5 = b"\x89HDF\r\n\x1a\n"
_REMEDY = "save times and values as CSV"
NamedArray = tuple[str, str, Any]
"""Name, unit and values."""


def _evidence(head: bytes) -> str:
    if head.startswith(b"\x93NUMPY") or (head.startswith(ZIP_MAGIC) and head[30:128].partition(b".npy")[1]):
        return "it begins with the bytes of numpy's files"
    if head.startswith((b"MATLAB 5.0 MAT", b"MATLAB 7.3 MAT")):
        return "it begins with the bytes of a MATLAB file"
    return "it begins with the bytes of HDF5 or netCDF" if head.startswith((_HDF5, b"CDF\x01", b"CDF\x02")) else ""


def _arrays(data: bytes) -> Iterator[NamedArray]:
    file = io.BytesIO(data)
    if data.startswith((b"\x93NUMPY", ZIP_MAGIC)):
        if data.startswith(ZIP_MAGIC):
            _limit(sum(each.file_size for each in zipfile.ZipFile(file).infolist()))
        read = np.load(file, allow_pickle=False)
        for name, array in [("", read)] if isinstance(read, np.ndarray) else read.items():
            yield from (
                ((field, "", array[field]) for field in array.dtype.names or ())
                if array.dtype.names
                else [(name, "", array)]
            )
    elif data.startswith(b"MATLAB 5.0"):
        import scipy.io

        _limit(sum(8 * math.prod(shape) for _, shape, _ in scipy.io.whosmat(file)))
        yield from _fields("", scipy.io.loadmat(file, simplify_cells=True))
    elif data.startswith(b"CDF"):
        import scipy.io

        with scipy.io.netcdf_file(file, mmap=False, maskandscale=True) as dataset:
            for name, variable in dataset.variables.items():
                yield name, getattr(variable, "units", b"").decode("utf-8", "replace"), variable[:].copy()
    else:
        yield from _of_hdf5(file)


def _fields(name: str, value: Any) -> Iterator[NamedArray]:
    """Yield the arrays in the structures of a MATLAB file."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            if not key.startswith("__"):
                yield from _fields(f"{name}.{key}" if name else key, inner)
    elif isinstance(value, np.ndarray):
        yield name, "", value


def _of_hdf5(file: io.BytesIO) -> Iterator[NamedArray]:
    import h5py

    with h5py.File(file) as opened:
        datasets: list[Any] = []
        opened.visititems(lambda _, item: datasets.append(item) if isinstance(item, h5py.Dataset) else None)
        numeric = [
            each for each in datasets if each.dtype.kind in "iuf" and 0 < each.ndim <= 2 and "#refs#" not in each.name
        ]
        _limit(sum(each.size * each.dtype.itemsize for each in numeric))
        for each in numeric:
            unit, fill = each.attrs.get("units", ""), each.attrs.get("_FillValue")
            values = each[...].astype(np.float64)
            if fill is not None:
                values[values == np.ravel(fill)[0]] = np.nan
            scale, offset = (float(np.ravel(each.attrs.get(key, default))[0]) for key, default in _PACKED)
            text = unit.decode("utf-8", "replace") if isinstance(unit, bytes) else str(unit)
            yield each.name.strip("/").replace("/", "."), text, values * scale + offset


_PACKED = (("scale_factor", 1.0), ("add_offset", 0.0))
"""Attributes of packed variables, and their defaults."""


def _limit(size: int) -> None:
    if size > MOST_ARRAY_BYTES:
        raise ValueError(f"arrays of more than {MOST_ARRAY_BYTES} bytes")


def _tables(path: str, data: bytes) -> list[Table]:
    try:
        arrays = [each for each in _arrays(data) if each[2].dtype.kind in "iuf"]
    except Exception as error:
        # The libraries have no common error for a damaged file.
        problem = f"its arrays cannot be read ({type(error).__name__}: {' '.join(str(error).split())[:200]})"
        raise FormatError(path, problem, "check that it was copied whole; or " + _REMEDY) from error
    lengths: dict[int, list[tuple[Heading, Any]]] = {}
    for name, unit, array in arrays:
        squeezed = np.ma.filled(np.ma.asarray(np.squeeze(array)).astype(np.float64), np.nan)
        columns = (
            squeezed.reshape(1, -1) if squeezed.ndim < 2 else squeezed if len(squeezed) <= _MOST_COLUMNS else squeezed.T
        )
        plain, of_name = heading_of(name.rpartition(".")[2] or "column")
        for number, values in enumerate(columns[:_MOST_COLUMNS], 1):
            several = plain if len(columns) == 1 else f"{plain if len(arrays) > 1 else 'column'} {number}"
            heading = Heading(several, of_name or unit.partition(" since ")[0])
            lengths.setdefault(values.size, []).append((heading, values))
    tables = [_table(columns) for size, columns in lengths.items() if size >= _FEWEST]
    timed = [table for table in tables if table.is_timed]
    if not tables or not any(table.columns for table in tables):
        raise FormatError(path, "expected arrays of numbers, times and values, got none", _REMEDY)
    simulated = "simulated" if b"simulated" in data[: 1 << 16] else ""
    return [replace(each, title=simulated) for each in timed or tables if each.columns]


def _table(columns: list[tuple[Heading, Any]]) -> Table:
    headings, values = [heading for heading, _ in columns], [array for _, array in columns]
    header = Header("", 0, "", headings)
    times = times_by_name(header, values) or [at for at in (times_by_steps(headings, values),) if at is not None]
    aside = [at for at, each in enumerate(headings) if at in times or _is_aside(each)]
    roles = [
        replace(each, role="time" if at in times[:1] else "aside" if at in aside else "channel")
        for at, each in enumerate(headings)
    ]
    read = tuple(Column(each.name, each.unit, array) for each, array in columns)
    (table,) = side_by_side(Table(read), roles) or [Table(())]
    return table


def _is_aside(heading: Heading) -> bool:
    return is_time(heading.name) or time_unit(heading.unit) is not None or heading.name == "quality"


FORMAT = ColumnFormat("arrays", "arrays: numpy, MATLAB, HDF5, netCDF", _evidence, _tables)
