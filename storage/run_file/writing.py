"""Run files, written whole: :func:`write_run`.

Examples
--------
>>> import tempfile
>>> import numpy as np
>>> from acquisition.block import Block
>>> from acquisition.source import SourceInfo
>>> block = Block(0, np.arange(3) / 100, np.array([0.30, np.nan, 0.31]), np.array([0, 1, 0], np.uint8))
>>> with tempfile.TemporaryDirectory() as folder:
...     write_run(folder + "/run.h5", [block], SourceInfo("simulated", "spring.toml", 100.0)).name
'run.h5'
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.block import UNITS, Block, concatenate
from acquisition.recordings.recording import Original, Trap
from acquisition.source import SourceInfo
from storage.atomic import whole_h5, writing_h5
from storage.errors import WriteFailed
from storage.run_file import layout
from storage.run_file.header import FileEntry, Header
from storage.run_file.layout import CHUNK
from storage.run_file.values import stored

__all__ = ["write_run"]


def write_run(
    path: str | os.PathLike[str],
    blocks: Iterable[Block],
    info: SourceInfo,
    *,
    originals: Sequence[Original] = (),
    scene: Mapping[str, Any] | None = None,
    title: str = "",
    channel: str = "distance",
    traps: Sequence[Trap] = (),
    malformed_rows: int = 0,
    format: str = "",
    provenance: Mapping[str, Any] | None = None,
    overwrite: bool = False,
) -> Path:
    """Write a run file whole.

    The blocks are written as they come, so memory holds no more than a chunk of 65536 samples of them.

    Parameters
    ----------
    path : str or PathLike
        The file to be made.
    blocks : iterable of Block
        Blocks that follow each other without a gap. A column that some lack is filled there, as in
        :func:`acquisition.block.concatenate`.
    info : SourceInfo
        The source; its ``kind`` travels with the data.
    originals : sequence of Original
        Files to be given back bit for bit.
    scene : mapping, optional
        The scene's tables; JSON-able, string keys. Tuples come back as lists.
    title, channel, format : str
        The run's title, the quantity taken as distance, the family of recordings that read it.
    traps : sequence of Trap
        What was seen on reading.
    malformed_rows : int
        Rows that were not samples.
    provenance : mapping, optional
        Whatever else is known; JSON-able, string keys. ``software``, ``version``, ``created_utc``,
        ``start_time`` (ISO 8601, the moment of t = 0) and ``configuration`` are shown to other tools as well.
    overwrite : bool
        Whether a file that stands there may be replaced.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    RunExists
        If a file stands there and may not be replaced; no block has been asked for then.
    WriteFailed
        If the file cannot be written, blocks do not follow each other or hold two quantities, or the scene or the
        provenance holds what JSON cannot. What the iterable of blocks raises passes through. What stood there before
        stands.
    """
    path = Path(path)
    with whole_h5(path, overwrite=overwrite, libver=layout.LIBVER) as file:
        columns = _Columns(path, file, info)
        for block in blocks:
            columns.append(block)
        columns.finish()
        header = Header(
            info=info,
            first=columns.first or 0,
            samples=columns.rows,
            columns={name: digest.hexdigest() for name, digest in columns.digests.items()},
            originals=tuple(FileEntry(o.name, len(o.data), o.sha256) for o in originals),
            title=title,
            channel=channel,
            format=format,
            scene=scene,
            traps=tuple(traps),
            malformed_rows=malformed_rows,
            provenance=provenance or {},
            quantity=columns.quantity,
            unit=UNITS[columns.quantity],
        )
        with writing_h5(path):
            _write_originals(file, originals)
            _write_header(file, header)
    return path


class _Columns:
    """The growing arrays of a run file, written a whole chunk at a time."""

    def __init__(self, path: Path, file: Any, info: SourceInfo) -> None:
        self.path, self.file, self.sigma_m = path, file, info.sigma_m
        self.first: int | None = None
        self.quantity = "length"
        self.rows = 0
        self.digests: dict[str, Any] = {}
        self._pending: list[Block] = []
        self._written = 0

    def append(self, block: Block) -> None:
        """Take a block; write what fills whole chunks."""
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
        """Write the rest and tie every array to its dimension."""
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

    def _demand_fit(self, block: Block) -> None:
        expected = (self.first or 0) + self.rows
        if block.first != expected or block.first < 0 or expected + len(block) > 2**32:
            demand = f"a block that begins with sample {expected} was demanded, got first = {block.first}"
            raise WriteFailed(self.path, demand, "number blocks without gaps, and flag what is missing")
        if block.quantity != self.quantity:
            demand = f"samples of {self.quantity} were demanded, got {block.quantity} from sample {block.first} on"
            raise WriteFailed(self.path, demand, "write a run file for each quantity")
        for name, values in layout.arrays(block, None).items():
            if values is not None and values.shape != block.t.shape:
                demand = f"{len(block)} values of {name} from sample {block.first} were demanded"
                raise WriteFailed(self.path, f"{demand}, got shape {values.shape}", "make them equally long")

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
            for start in range(0, self._written, CHUNK):  # a column that comes late
                self._extend(column, start, np.full(CHUNK, column.fill, column.dtype))
        self._extend(column, self._written, values)

    def _extend(self, column: layout.Column, start: int, values: NDArray[Any]) -> None:
        array = self.file[column.path]
        if array.shape[0] < start + len(values):
            array.resize((start + len(values),))
        array[start : start + len(values)] = values
        self.digests[column.name].update(values.tobytes())


def _create(file: Any, path: str, dtype: str, length: int | None) -> Any:
    """Make an array of a known length, or a growing one; zero length only a growing one can have."""
    if length:
        return file.create_dataset(path, (length,), dtype, chunks=(min(length, CHUNK),), **layout.filters(path))
    chunk = CHUNK if length is None else 1
    return file.create_dataset(path, (0,), dtype, maxshape=(None,), chunks=(chunk,), **layout.filters(path))


def _write_originals(file: Any, originals: Sequence[Original]) -> None:
    if not originals:
        return
    sizes = np.array([len(original.data) for original in originals], "<u8")
    data = _create(file, f"{layout.WIRE}/bytes", "|u1", int(sizes.sum()))
    start = 0
    for original in originals:
        if original.data:
            data[start : start + len(original.data)] = np.frombuffer(original.data, np.uint8)
        start += len(original.data)
    records = layout.records(sizes)
    wire = file[layout.WIRE]
    for name, values in records.items():
        _create(file, f"{layout.WIRE}/{name}", values.dtype.str, len(values))[:] = values
    _dimension(wire, "byte", [data])
    _dimension(wire, "record", [wire[name] for name in records])


def _dimension(group: Any, name: str, arrays: Sequence[Any]) -> None:
    """Tie arrays to a dimension without coordinates, in netCDF's own way: a scale of this very title."""
    length = arrays[0].shape[0]
    growing: dict[str, Any] = {} if length else {"maxshape": (None,), "chunks": (1,)}
    scale = group.create_dataset(name, (length,), ">f4", **growing)
    scale.make_scale(f"This is a netCDF dimension but not a netCDF variable.{length:10d}")
    for array in arrays:
        array.dims[0].attach_scale(scale)


def _write_header(file: Any, header: Header) -> None:
    text = header.encode()
    text_array = file.create_dataset(layout.HEADER, data=np.bytes_(text))
    text_array.attrs["sha256"] = np.bytes_(hashlib.sha256(text).hexdigest())
    for path, value in layout.fields(header).items():
        data, dtype = stored(value)
        file.create_dataset(path, data=data, dtype=dtype)
    for path, attributes in layout.attributes(header).items():
        carrier = file.require_group(path) if path not in file else file[path]
        for name, value in attributes.items():
            data, dtype = stored(value)
            carrier.attrs.create(name, data, dtype=dtype)
