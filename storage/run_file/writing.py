"""Write run files whole: :func:`write_run`, and :func:`run_writer` for samples that arrive piece by piece."""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.block import UNITS, Block, SourceInfo, concatenate
from acquisition.recordings.recording import FormatIssue, Original
from storage.errors import WriteFailed
from storage.hdf5 import whole_h5, writing_h5
from storage.run_file import layout
from storage.run_file.header import FileEntry, Info, RunHeader, TrapEntry
from storage.run_file.layout import CHUNK
from storage.schema import plain


def write_run(
    path: str | os.PathLike[str],
    blocks: Iterable[Block],
    info: SourceInfo,
    *,
    originals: Sequence[Original] = (),
    provenance: Mapping[str, Any] | None = None,
    overwrite: bool = False,
    **header: Any,
) -> Path:
    """Write a run file whole.

    The blocks are written as they arrive, so at most a chunk of 65536 samples and one block are kept in memory.
    ``header`` are further fields of :class:`storage.run_file.header.RunHeader`, and the reader's ``traps``.
    """
    with run_writer(path, sigma_m=info.sigma_m, overwrite=overwrite) as run:
        for block in blocks:
            run.append(block)
        run.keep([(original.name, len(original.data), [original.data]) for original in originals])
        run.finish(info, provenance=provenance or {}, **header)
    return Path(path)


@contextlib.contextmanager
def run_writer(
    path: str | os.PathLike[str], *, sigma_m: float | None = None, overwrite: bool = False
) -> Iterator[RunWriter]:
    """Yield a writer of a run file, and move the file into place when the ``with`` ends without an error.

    ``sigma_m`` is the standard deviation of a distance, as stated by the source, m. The caller appends blocks, keeps
    original files, and finishes the file. Raises RunExists and WriteFailed like :func:`write_run`.
    """
    with whole_h5(Path(path), overwrite=overwrite) as file:
        yield RunWriter(Path(path), file, sigma_m)


class RunWriter:
    """Writes a run file piece by piece with one chunk of samples in memory; made by :func:`run_writer`."""

    def __init__(self, path: Path, file: Any, sigma_m: float | None) -> None:
        self.path = path
        self._file, self._sigma_m = file, sigma_m
        self._first: int | None = None
        self._quantity = "length"
        self._rows = self._written = 0
        self._pending: list[Block] = []
        self._digests: dict[str, Any] = {}
        self._originals: tuple[FileEntry, ...] = ()

    def append(self, block: Block) -> None:
        """Append the next samples, and write all complete chunks."""
        if self._first is None:
            self._first, self._quantity = block.first, block.quantity
        self._demand_fit(block, self._first + self._rows)
        self._pending.append(block)
        self._rows += len(block)
        if self._rows - self._written >= CHUNK:
            whole = concatenate(self._pending)
            full = len(whole) // CHUNK * CHUNK
            self._write(whole[:full], growing=True)
            self._pending = [whole[full:]]

    def keep(self, files: Sequence[tuple[str, int, Iterable[bytes]]]) -> None:
        """Store original files bit for bit, each given by its name, its size and its bytes in pieces."""
        if not files:
            return
        with writing_h5(self.path):
            array = _create(self._file, f"{layout.WIRE}/bytes", "|u1", sum(size for _, size, _ in files))
            _attach(self._file[layout.WIRE], "byte", array)
        at = 0
        for name, size, pieces in files:
            start, digest = at, hashlib.sha256()
            for piece in pieces:
                digest.update(piece)
                at += len(piece)
                if piece and at <= start + size:
                    with writing_h5(self.path):
                        array[at - len(piece) : at] = np.frombuffer(piece, np.uint8)
            if at != start + size:
                problem = f"expected {size} bytes of {name}, got {at - start}: it has changed meanwhile"
                raise WriteFailed(self.path, problem, "try again")
            self._originals += (FileEntry(name, size, digest.hexdigest()),)
        with writing_h5(self.path):
            del array  # HDF5 writes the rest

    def finish(self, info: SourceInfo, *, traps: Sequence[FormatIssue] = (), **header: Any) -> None:
        """Write the remaining samples and the header.

        ``header`` has the fields of :class:`storage.run_file.header.RunHeader` that do not follow from the samples and
        the originals. Raises WriteFailed if one of them has a value that is not allowed.
        """
        pending = concatenate(self._pending)
        if not self._written or len(pending):
            self._write(pending, growing=bool(self._written))
        with writing_h5(self.path):
            self._write_dimensions()
            text = RunHeader(
                info=Info(**plain(info)),
                traps=tuple(TrapEntry(**plain(trap)) for trap in traps),
                first=self._first or 0,
                samples=self._rows,
                columns={name: digest.hexdigest() for name, digest in self._digests.items()},
                originals=self._originals,
                quantity=self._quantity,
                unit=UNITS[self._quantity],
                **header,
            )
            _write_header(self._file, text)

    def _demand_fit(self, block: Block, expected: int) -> None:
        if block.first != expected or block.first < 0:
            problem = f"expected a block that begins with sample {max(expected, 0)}, got {block.first}"
            raise WriteFailed(self.path, problem, "number blocks without gaps, and flag missing samples")
        if block.quantity != self._quantity:
            problem = f"expected samples of {self._quantity}, got {block.quantity} from sample {block.first} on"
            raise WriteFailed(self.path, problem, "write a run file for each quantity")
        for name, values in layout.arrays(block, None).items():
            if values is not None and values.shape != block.t.shape:
                problem = f"expected {len(block)} values of {name} from sample {block.first}, got shape {values.shape}"
                raise WriteFailed(self.path, problem, "give every column the same length")

    def _write(self, block: Block, *, growing: bool) -> None:
        values = layout.arrays(block, self._sigma_m)
        for column in layout.STORED_COLUMNS:
            array = values.get(column.name)
            if array is None and column.name not in self._digests:
                continue
            if array is None:
                array = np.full(len(block), column.fill)
            with writing_h5(self.path):
                exact = np.ascontiguousarray(array).astype(column.dtype, casting="safe", copy=False)
                self._write_column(column, exact, growing=growing)
        self._written += len(block)

    def _write_column(self, column: layout.StoredColumn, values: NDArray[Any], *, growing: bool) -> None:
        if column.name not in self._digests:
            self._digests[column.name] = hashlib.sha256()
            _create(self._file, column.path, column.dtype, None if growing else len(values))
            for start in range(0, self._written, CHUNK):  # fill a column that is missing in earlier blocks
                self._extend(column, start, np.full(CHUNK, column.fill, column.dtype))
        self._extend(column, self._written, values)

    def _extend(self, column: layout.StoredColumn, start: int, values: NDArray[Any]) -> None:
        array = self._file[column.path]
        if array.shape[0] < start + len(values):
            array.resize((start + len(values),))
        array[start : start + len(values)] = values
        self._digests[column.name].update(values.tobytes())

    def _write_dimensions(self) -> None:
        """Attach the arrays to their dimensions, and link those of the signal at the root."""
        signal = self._file[layout.SIGNAL]
        signal["time"].make_scale("time")
        for name, array in signal.items():
            if name != "time":
                array.dims[0].attach_scale(signal["time"])
            self._file[name] = array  # a hard link to the same array, which takes no space
        if "host_mono_ns" in self._digests:
            _attach(self._file["raw"], "sample", self._file["raw/host_mono_ns"])


def _write_header(file: Any, header: RunHeader) -> None:
    text = header.encode()
    text_array = file.create_dataset(layout.HEADER, data=np.bytes_(text))
    text_array.attrs["sha256"] = np.bytes_(hashlib.sha256(text).hexdigest())
    for path, value in layout.fields(header).items():
        data, dtype = layout.stored(value)
        file.create_dataset(path, data=data, dtype=dtype)
    for path, attributes in layout.attributes(header).items():
        carrier = file.require_group(path) if path not in file else file[path]
        for name, value in attributes.items():
            data, dtype = layout.stored(value)
            carrier.attrs.create(name, data, dtype=dtype)


def _create(file: Any, path: str, dtype: str, length: int | None) -> Any:
    """Create an array of fixed length, or a growing one; HDF5 allows zero length only for a growing array."""
    if length:
        return file.create_dataset(path, (length,), dtype, chunks=(min(length, CHUNK),), **layout.filters(path))
    chunk = CHUNK if length is None else 1
    return file.create_dataset(path, (0,), dtype, maxshape=(None,), chunks=(chunk,), **layout.filters(path))


def _attach(group: Any, name: str, array: Any) -> None:
    """Attach an array to a dimension without coordinates as netCDF does, with a scale of this exact title."""
    length = array.shape[0]
    growing: dict[str, Any] = {} if length else {"maxshape": (None,), "chunks": (1,)}
    scale = group.create_dataset(name, (length,), ">f4", **growing)
    scale.make_scale(f"This is a netCDF dimension but not a netCDF variable.{length:10d}")
    array.dims[0].attach_scale(scale)
