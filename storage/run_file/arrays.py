"""Write the arrays of a run file: samples chunk by chunk, original files as their bytes arrive."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.block import Block, concatenate
from storage.atomic import writing_h5
from storage.errors import WriteFailed
from storage.run_file import layout
from storage.run_file.header import FileEntry
from storage.run_file.layout import CHUNK

__all__ = ["Columns", "Originals"]


class Columns:
    """The growing arrays of a run file, written in whole chunks."""

    def __init__(self, path: Path, file: Any, sigma_m: float | None) -> None:
        self.path, self.file, self.sigma_m = path, file, sigma_m
        self.first: int | None = None
        self.quantity = "length"
        self.rows = 0
        self.digests: dict[str, Any] = {}
        self._pending: list[Block] = []
        self._written = 0

    def append(self, block: Block) -> None:
        """Append a block, and write all complete chunks."""
        if self.first is None:
            self.first, self.quantity = block.first, block.quantity
        self._demand_fit(block)
        self._pending.append(block)
        self.rows += len(block)
        if self.rows - self._written >= CHUNK:
            whole = concatenate(self._pending)
            full = len(whole) // CHUNK * CHUNK
            self._write(whole[:full], growing=True)
            self._pending = [whole[full:]]

    def finish(self) -> None:
        """Write the remaining samples, attach arrays to their dimensions, and link the signal's arrays at the root."""
        rest = concatenate(self._pending)
        if not self._written or len(rest):
            self._write(rest, growing=bool(self._written))
        with writing_h5(self.path):
            for group, scale in ((layout.SIGNAL, "time"), ("/raw", "sequence")):
                arrays = self.file[group]
                arrays[scale].make_scale(scale)
                for name in arrays:
                    if name != scale:
                        arrays[name].dims[0].attach_scale(arrays[scale])
            for name, array in self.file[layout.SIGNAL].items():
                self.file[name] = array  # a hard link to the same array, which takes no space

    def _demand_fit(self, block: Block) -> None:
        expected = (self.first or 0) + self.rows
        if block.first != expected or block.first < 0:
            problem = f"expected a block that begins with sample {max(expected, 0)}, got {block.first}"
            raise WriteFailed(self.path, problem, "number blocks without gaps, and flag missing samples")
        if expected + len(block) > 2**32:
            problem = f"expected at most {2**32} samples, got {expected + len(block)}"
            raise WriteFailed(self.path, problem, "write several run files")
        if block.quantity != self.quantity:
            problem = f"expected samples of {self.quantity}, got {block.quantity} from sample {block.first} on"
            raise WriteFailed(self.path, problem, "write a run file for each quantity")
        for name, values in layout.arrays(block, None).items():
            if values is not None and values.shape != block.t.shape:
                problem = f"expected {len(block)} values of {name} from sample {block.first}, got shape {values.shape}"
                raise WriteFailed(self.path, problem, "give every column the same length")

    def _write(self, block: Block, *, growing: bool) -> None:
        with writing_h5(self.path):
            values = layout.arrays(block, self.sigma_m)
            for column in layout.COLUMNS:
                array = values[column.name]
                if array is None and column.name not in self.digests:
                    continue
                if array is None:
                    array = np.full(len(block), column.fill)
                exact = np.ascontiguousarray(array).astype(column.dtype, casting="safe", copy=False)
                column.demand_within(exact, self._written)
                self._write_column(column, exact, growing)
        self._written += len(block)

    def _write_column(self, column: layout.Column, values: NDArray[Any], growing: bool) -> None:
        if column.name not in self.digests:
            self.digests[column.name] = hashlib.sha256()
            _create(self.file, column.path, column.dtype, None if growing else len(values))
            for start in range(0, self._written, CHUNK):  # fill a column that is missing in earlier blocks
                self._extend(column, start, np.full(CHUNK, column.fill, column.dtype))
        self._extend(column, self._written, values)

    def _extend(self, column: layout.Column, start: int, values: NDArray[Any]) -> None:
        array = self.file[column.path]
        if array.shape[0] < start + len(values):
            array.resize((start + len(values),))
        array[start : start + len(values)] = values
        self.digests[column.name].update(values.tobytes())


def _create(file: Any, path: str, dtype: str, length: int | None) -> Any:
    """Create an array of fixed length, or a growing one; HDF5 allows zero length only for a growing array."""
    if length:
        return file.create_dataset(path, (length,), dtype, chunks=(min(length, CHUNK),), **layout.filters(path))
    chunk = CHUNK if length is None else 1
    return file.create_dataset(path, (0,), dtype, maxshape=(None,), chunks=(chunk,), **layout.filters(path))


class Originals:
    """The original files of a run, written as their bytes arrive."""

    def __init__(self, file: Any, files: Sequence[tuple[str, int]]) -> None:
        self._names = [name for name, _ in files]
        self._digests = [hashlib.sha256() for _ in files]
        self._taken = [0] * len(files)
        sizes = np.array([size for _, size in files], "<u8")
        self._sizes, self._starts = sizes.tolist(), (np.cumsum(sizes, dtype="<u8") - sizes).tolist()
        self._bytes = _create(file, f"{layout.WIRE}/bytes", "|u1", int(sizes.sum()))
        records = layout.records(sizes)
        wire = file[layout.WIRE]
        for name, values in records.items():
            _create(file, f"{layout.WIRE}/{name}", values.dtype.str, len(values))[:] = values
        _dimension(wire, "byte", [self._bytes])
        _dimension(wire, "record", [wire[name] for name in records])

    def take(self, number: int, data: bytes) -> None:
        """Append the next bytes of a file."""
        start = self._starts[number] + self._taken[number]
        self._taken[number] += len(data)
        self._digests[number].update(data)
        if data and self._taken[number] <= self._sizes[number]:
            self._bytes[start : start + len(data)] = np.frombuffer(data, np.uint8)

    def entries(self) -> tuple[FileEntry, ...]:
        """Return the files' entries for the header.

        Raises
        ------
        ValueError
            If a file is incomplete.
        """
        for name, size, taken in zip(self._names, self._sizes, self._taken, strict=True):
            if taken != size:
                raise ValueError(f"expected {size} bytes of {name}, got {taken}: it has changed meanwhile")
        digests = (digest.hexdigest() for digest in self._digests)
        return tuple(FileEntry(*entry) for entry in zip(self._names, self._sizes, digests, strict=True))


def _dimension(group: Any, name: str, arrays: Sequence[Any]) -> None:
    """Attach arrays to a dimension without coordinates as netCDF does, with a scale of this exact title."""
    length = arrays[0].shape[0]
    growing: dict[str, Any] = {} if length else {"maxshape": (None,), "chunks": (1,)}
    scale = group.create_dataset(name, (length,), ">f4", **growing)
    scale.make_scale(f"This is a netCDF dimension but not a netCDF variable.{length:10d}")
    for array in arrays:
        array.dims[0].attach_scale(scale)
