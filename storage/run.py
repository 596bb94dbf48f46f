"""Run files: :func:`write_run` makes one whole, :func:`open_run` reads it lazily and checks what it reads.

Examples
--------
>>> import tempfile
>>> import numpy as np
>>> from acquisition.block import Block
>>> from acquisition.source import SourceInfo
>>> block = Block(0, np.arange(3) / 100, np.array([0.30, np.nan, 0.31]), np.array([0, 1, 0], np.uint8))
>>> with tempfile.TemporaryDirectory() as folder:
...     path = write_run(folder + "/run.h5", [block], SourceInfo("simulated", "spring.toml", 100.0))
...     with open_run(path) as run:
...         run.info.kind, len(run), run.samples().distance
('simulated', 3, array([0.3 ,  nan, 0.31]))
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import h5py
import numpy as np
from numpy.typing import NDArray

from acquisition.block import Block, concatenate
from acquisition.recording import Original, Trap
from acquisition.source import SourceInfo
from storage import layout
from storage.atomic import whole_h5, writing_h5
from storage.errors import HDF5_ERRORS, NotARun, RunClosed, RunDamaged, StorageError, WriteFailed, one_line
from storage.layout import CHUNK, FileEntry, Header

if TYPE_CHECKING:
    import xarray

__all__ = ["Run", "is_run", "open_run", "write_run"]


def is_run(head: bytes) -> bool:
    """Tell from a file's first eight bytes whether it may be a run file: whether it is HDF5.

    Whether it is one of ours, :func:`open_run` says.
    """
    return head.startswith(layout.MAGIC)


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
        If the file cannot be written, blocks do not follow each other, or the scene or the provenance holds
        what JSON cannot. What the iterable of blocks raises passes through. What stood there before stands.
    """
    path = Path(path)
    with whole_h5(path, overwrite=overwrite, libver=layout.LIBVER) as file:
        columns = _Columns(path, file, info.sigma_m)
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
        )
        with writing_h5(path):
            _write_originals(file, originals)
            _write_header(file, header)
    return path


def open_run(path: str | os.PathLike[str]) -> Run:
    """Open a run file for reading.

    Returns
    -------
    Run
        To be used in a ``with``, or closed.

    Raises
    ------
    NotARun
        If nothing is there, or something else.
    RunDamaged
        If the file cannot be read, or its header is not what was written.
    """
    path = Path(path)
    remedy = "name a run file; springmass formats FILE says what a file is"
    try:
        with path.open("rb") as stream:
            head = stream.read(len(layout.MAGIC))
    except OSError as error:
        raise NotARun(path, f"a run file was demanded, got none ({error.strerror})", remedy) from error
    if not is_run(head):
        raise NotARun(path, f"a run file (HDF5) was demanded, got a file that begins with {head!r}", remedy)
    with _reading(path, "the file"):
        file = h5py.File(path, "r")
    try:
        return Run(path, file, _read_header(path, file))
    except BaseException:
        file.close()
        raise


class Run:
    """An open run file.

    What it says of itself is read at once, samples when they are asked for. Nothing is delivered unchecked:
    every chunk carries a checksum, and every column read to its end is held against its SHA-256.

    Parameters
    ----------
    path : Path
        The file.
    file : h5py.File
        The same, open; closed by :meth:`close`.
    header : Header
        Its header.
    """

    __slots__ = ("_file", "_header", "path")

    def __init__(self, path: Path, file: Any, header: Header) -> None:
        self.path = path
        self._file = file
        self._header = header

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; again does no harm."""
        self._file.close()

    def __len__(self) -> int:
        """Return the number of samples."""
        return self._header.samples

    def __repr__(self) -> str:
        return f"<Run {os.fspath(self.path)!r}: {len(self)} samples, {self.info.kind}>"

    @property
    def info(self) -> SourceInfo:
        """The source."""
        return self._header.info

    @property
    def title(self) -> str:
        """The run's title; empty where it has none."""
        return self._header.title

    @property
    def channel(self) -> str:
        """The quantity or column taken as distance."""
        return self._header.channel

    @property
    def format(self) -> str:
        """The family of recordings that read it; empty where none did."""
        return self._header.format

    @property
    def scene(self) -> Mapping[str, Any] | None:
        """The scene's tables; None where none were given."""
        return self._header.scene

    @property
    def traps(self) -> tuple[Trap, ...]:
        """What was seen on reading the old file."""
        return self._header.traps

    @property
    def malformed_rows(self) -> int:
        """Rows of the old file that were not samples."""
        return self._header.malformed_rows

    @property
    def provenance(self) -> Mapping[str, Any]:
        """What the writer said of software, configuration and times."""
        return self._header.provenance

    @property
    def sha256(self) -> str:
        """SHA-256 of the content: of the header, which holds those of all arrays and original files.

        Two files of the same content have the same, whatever their bytes.
        """
        return hashlib.sha256(self._header.encode()).hexdigest()

    def blocks(self, size: int = 1024) -> Iterable[Block]:
        """Return the samples in blocks, read as they are asked for.

        Parameters
        ----------
        size : int
            Samples a block; the last may be shorter.

        Returns
        -------
        iterable of Block
            Can be gone through more than once, while the run is open.

        Raises
        ------
        ValueError
            If ``size`` is not positive.
        RunDamaged
            While iterating: where a chunk cannot be read, and before the last chunk's blocks where a whole
            column is not what was written.
        """
        if size < 1:
            raise ValueError(f"blocks hold at least 1 sample, got size = {size}")
        return _Blocks(self, size)

    def samples(self) -> Block:
        """Return all samples as one block.

        Raises
        ------
        RunDamaged
            If they are not what was written.
        """
        first = self._header.first
        if not len(self):
            return _block(first, {name: self._column(name)[:] for name in self._header.columns})
        (block,) = self.blocks(len(self))
        return block

    def dataset(self) -> xarray.Dataset:
        """Return the samples as a dataset in memory, checked and free of the file.

        No handle stays open behind it, for an open one keeps others from the file. Whoever wants lazy arrays
        opens the file itself: ``xarray.open_dataset(path, group="entry/signal", engine="h5netcdf")``.

        Returns
        -------
        xarray.Dataset
            On the dimension ``time``: time (s), distance (m), quality, and where the file has them
            distance_errors (m) and velocity (m/s), with the file's attributes. Its own attributes are kind,
            channel, title, format and the instrument's name, clock and numbers.

        Raises
        ------
        RunDamaged
            If the samples are not what was written.
        """
        import xarray as xr

        values = layout.arrays(self.samples(), self.info.sigma_m)
        variables = {}
        for column in layout.COLUMNS:
            if column.path.startswith(layout.SIGNAL) and column.name in self._header.columns:
                attributes = layout.column_attributes(column, self._header)
                attributes.pop("_FillValue", None)
                variables[column.name] = ("time", values[column.name], attributes)
        instrument = {
            path.rpartition("/")[2]: value
            for path, value in layout.fields(self._header).items()
            if path.startswith(layout.INSTRUMENT)
        }
        return xr.Dataset(variables, attrs=instrument | layout.signal_attributes(self._header))

    def originals(self) -> tuple[Original, ...]:
        """Return the original files, bit for bit; none where none were kept.

        Raises
        ------
        RunDamaged
            If one is not what was written.
        """
        found = []
        start = 0
        for entry in self._header.originals:
            what = f"the original file {entry.name!r}"
            with _reading(self.path, what):
                data = self._open()[f"{layout.WIRE}/bytes"][start : start + entry.size].tobytes()
            original = Original(entry.name, data)
            if original.sha256 != entry.sha256:
                raise _damaged(self.path, what, "its SHA-256 differs")
            found.append(original)
            start += entry.size
        return tuple(found)

    def verify(self) -> None:
        """Read everything again and hold it against what was written.

        Raises
        ------
        RunDamaged
            Naming the first array, original file, field or attribute that differs.
        """
        for _ in self.blocks(CHUNK):
            pass
        for name in ("distance_errors", "sequence"):  # no block carries them
            if name in self._header.columns:
                with _reading(self.path, f"the column {name!r}"):
                    digest = hashlib.sha256(self._column(name)[:].tobytes())
                self._check(name, digest.hexdigest())
        self.originals()
        for path, value in layout.fields(self._header).items():
            with _reading(self.path, f"the field {path}"):
                found = self._open()[path][()]
            self._compare(f"the field {path}", found, value)
        for path, expected in layout.attributes(self._header).items():
            self._verify_attributes(path, expected)

    def _verify_attributes(self, path: str, expected: Mapping[str, Any]) -> None:
        with _reading(self.path, f"an attribute of {path}"):
            carrier = self._open()[path].attrs
            found = {name: carrier[name] for name in carrier if name not in _DIMENSION_ATTRIBUTES}
        if odd := sorted(set(found) ^ set(expected)):
            state = "is missing" if odd[0] in expected else "was added"
            raise _damaged(self.path, f"the attribute {path}@{odd[0]}", f"it {state}")
        for name, value in expected.items():
            self._compare(f"the attribute {path}@{name}", found[name], value)

    def _compare(self, what: str, found: Any, value: Any) -> None:
        data, dtype = _stored(value)
        expected = np.asarray(data, dtype)
        if repr(np.asarray(found).tolist()) != repr(expected.tolist()):
            raise _damaged(self.path, what, f"{expected.tolist()!r} was written, got {found!r}")

    def _open(self) -> Any:
        """Return the file, if it is open."""
        if not self._file:
            raise RunClosed(self.path, "an open run was demanded, got a closed one", "read inside its with")
        return self._file

    def _column(self, name: str) -> Any:
        """Return a column's array on disk, its type and length checked."""
        column = next(column for column in layout.COLUMNS if column.name == name)
        what = f"the column {name!r}"
        with _reading(self.path, what):
            found = self._open()[column.path]
            is_, demanded = (found.dtype.str, found.shape), (column.dtype, (len(self),))
        if is_ != demanded:
            raise _damaged(self.path, what, f"type and shape {demanded} were written, got {is_}")
        return found

    def _check(self, name: str, sha256: str) -> None:
        if sha256 != self._header.columns[name]:
            raise _damaged(self.path, f"the column {name!r}", "its SHA-256 differs")


@dataclass(frozen=True, slots=True)
class _Blocks:
    """The samples of a run in blocks, anew at every iteration."""

    run: Run
    size: int

    def __iter__(self) -> Iterator[Block]:
        run = self.run
        names = [name for name in _BLOCK_COLUMNS if name in run._header.columns]
        columns = {name: run._column(name) for name in names}
        digests = {name: hashlib.sha256() for name in names}
        step = self.size * max(1, CHUNK // self.size)  # whole blocks, about a chunk at a time
        for start in range(0, len(run), step):
            values = {}
            for name in names:
                with _reading(run.path, f"the column {name!r} from sample {start}"):
                    run._open()
                    values[name] = columns[name][start : start + step]
                digests[name].update(values[name].tobytes())
            if start + step >= len(run):
                for name, digest in digests.items():
                    run._check(name, digest.hexdigest())
            read = _block(run._header.first + start, values)
            for row in range(0, len(read), self.size):
                yield read[row : row + self.size]


_BLOCK_COLUMNS = {
    "time": "t",
    "distance": "distance",
    "quality": "flags",
    "host_mono_ns": "host_ns",
    "velocity": "velocity",
}


def _block(first: int, values: Mapping[str, NDArray[Any]]) -> Block:
    fields: dict[str, Any] = {_BLOCK_COLUMNS[n]: array for n, array in values.items() if n in _BLOCK_COLUMNS}
    return Block(first, **fields)


class _Columns:
    """The growing arrays of a run file, written a whole chunk at a time."""

    def __init__(self, path: Path, file: Any, sigma_m: float | None) -> None:
        self.path, self.file, self.sigma_m = path, file, sigma_m
        self.first: int | None = None
        self.rows = 0
        self.digests: dict[str, Any] = {}
        self._pending: list[Block] = []
        self._written = 0

    def append(self, block: Block) -> None:
        """Take a block; write what fills whole chunks."""
        if self.first is None:
            self.first = block.first
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
        return file.create_dataset(path, (length,), dtype, chunks=(min(length, CHUNK),), **layout.FILTERS)
    chunk = CHUNK if length is None else 1
    return file.create_dataset(path, (0,), dtype, maxshape=(None,), chunks=(chunk,), **layout.FILTERS)


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
    records = {
        "record_offset": np.cumsum(sizes, dtype="<u8") - sizes,
        "record_len": sizes,
        "record_mono_ns": np.full(len(sizes), layout.NO_HOST_NS, "<i8"),
    }
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


_DIMENSION_ATTRIBUTES = {"CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST"}


def _write_header(file: Any, header: Header) -> None:
    text = header.encode()
    stored = file.create_dataset(layout.HEADER, data=np.bytes_(text))
    stored.attrs["sha256"] = np.bytes_(hashlib.sha256(text).hexdigest())
    for path, value in layout.fields(header).items():
        data, dtype = _stored(value)
        file.create_dataset(path, data=data, dtype=dtype)
    for path, attributes in layout.attributes(header).items():
        carrier = file.require_group(path) if path not in file else file[path]
        for name, value in attributes.items():
            data, dtype = _stored(value)
            carrier.attrs.create(name, data, dtype=dtype)


def _stored(value: Any) -> tuple[Any, Any]:
    """Return a value as HDF5 is given it, with its type.

    Texts get a fixed length, as netCDF's own library writes them. Texts of free length would lie in HDF5's
    global heap, the one part of the file without a checksum: a flipped bit there changes them unseen, or
    sends the HDF5 library into an endless loop.
    """
    if not isinstance(value, str | tuple):
        return value, None
    texts = [_shown(text).encode() for text in ((value,) if isinstance(value, str) else value)]
    dtype = h5py.string_dtype(length=max(1, *map(len, texts)))
    return (texts[0] if isinstance(value, str) else np.array(texts, dtype)), dtype


def _read_header(path: Path, file: Any) -> Header:
    what = "the header"
    with _reading(path, what):
        if layout.HEADER not in file:
            demand = f"a run file was demanded, got HDF5 without {layout.HEADER}"
            raise NotARun(path, demand, "name a run file, or convert the recording to one")
        stored = file[layout.HEADER]
        text, sha256 = bytes(stored[()]), bytes(stored.attrs["sha256"]).decode()
    if hashlib.sha256(text).hexdigest() != sha256:
        raise _damaged(path, what, "its SHA-256 differs")
    try:
        return Header.decode(text)
    except (KeyError, TypeError, ValueError) as error:
        demand = f"a run file of schema {layout.SCHEMA} was demanded, got another ({one_line(error)})"
        raise NotARun(path, demand, "read it with the version of springmass that wrote it") from error


def _shown(text: str) -> str:
    """Return a text as HDF5 can hold it, without NUL and lone surrogates; the header holds the exact one."""
    return text.replace("\0", "\ufffd").encode("utf-16", "surrogatepass").decode("utf-16", "replace")


def _damaged(path: Path, what: str, how: str) -> RunDamaged:
    remedy = "restore the file from a copy, or make it again from the wire log or the old recording"
    return RunDamaged(path, f"{what} is not what was written: {how}", remedy)


@contextlib.contextmanager
def _reading(path: Path, what: str) -> Iterator[None]:
    """Turn what HDF5 raises on damaged bytes into one line."""
    try:
        yield
    except StorageError:
        raise
    except HDF5_ERRORS as error:
        raise _damaged(path, what, one_line(error)) from error
