"""Read run files: :func:`open_run` opens one lazily and checks what it reads.

Examples
--------
>>> import tempfile
>>> import numpy as np
>>> from acquisition.block import Block
>>> from acquisition.source import SourceInfo
>>> from storage.run_file.writing import write_run
>>> block = Block(0, np.arange(3) / 100, np.array([0.30, np.nan, 0.31]), np.array([0, 1, 0], np.uint8))
>>> with tempfile.TemporaryDirectory() as folder:
...     path = write_run(folder + "/run.h5", [block], SourceInfo("simulated", "spring.toml", 100.0))
...     with open_run(path) as run:
...         run.info.kind, len(run), run.samples().distance
('simulated', 3, array([0.3 ,  nan, 0.31]))
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from numpy.typing import NDArray

from acquisition.block import Block
from acquisition.recordings.recording import Original, Trap
from acquisition.regular_file import open_regular
from acquisition.source import SourceInfo
from storage.errors import NotARun, RunDamaged, reading
from storage.run_file import layout
from storage.run_file import verification as verify
from storage.run_file.dataset import checked_dataset, lazy_dataset
from storage.run_file.handle import Contents, open_header
from storage.run_file.header import Header
from storage.run_file.layout import CHUNK
from storage.schema import plain

if TYPE_CHECKING:
    import xarray

__all__ = ["CHECKED", "Run", "is_run", "open_run"]


def is_run(head: bytes) -> bool:
    """Return whether a file's first eight bytes are those of HDF5, so that it may be a run file.

    :func:`open_run` checks whether it really is one.
    """
    return head.startswith(layout.MAGIC)


def open_run(path: str | os.PathLike[str], *, unverified: bool = False) -> Run:
    """Open a run file for reading.

    Parameters
    ----------
    path : str or PathLike
    unverified : bool
        Whether to return data even if their digest differs; :meth:`Run.differences` lists the differences.

    Returns
    -------
    Run
        The open file. Use it in a ``with``, or close it.

    Raises
    ------
    NotARun
        If the file does not exist or is not a run file.
    RunDamaged
        If the file cannot be read, or its header is damaged or has a value that is not allowed.
    """
    path = Path(path)
    remedy = "name a run file; springmass formats FILE shows what a file is"
    try:
        with open_regular(path) as stream:
            head = stream.read(len(layout.MAGIC))
    except OSError as error:
        raise NotARun(path, f"the run file cannot be opened ({error.strerror or error})", remedy) from error
    if not is_run(head):
        raise NotARun(path, f"expected a run file (HDF5), got a file that begins with {head!r}", remedy)
    return Run(path, *open_header(path, unverified=unverified), unverified)


class Run(Contents):
    """An open run file.

    The header is read when the file is opened, samples on demand. Everything is checked: every chunk has a checksum,
    and every column that is read to its end is compared with its SHA-256. :meth:`blocks` and :meth:`dataset` read
    lazily, :meth:`samples` and :meth:`load_dataset` read everything.

    ``sha256`` is the digest of the header, which contains the digests of all arrays and original files. Two files with
    the same content therefore have the same ``sha256``, even if their bytes differ.
    """

    __slots__ = ()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file. Further calls do nothing."""
        self.handle.close()

    def __len__(self) -> int:
        """Return the number of samples."""
        return self.header.samples

    def __repr__(self) -> str:
        return f"<Run {os.fspath(self.path)!r}: {len(self)} samples, {self.info.kind}>"

    @property
    def info(self) -> SourceInfo:
        """The source."""
        return SourceInfo(**plain(self.header.info))

    @property
    def title(self) -> str:
        """The run's title; may be empty."""
        return self.header.title

    @property
    def channel(self) -> str:
        """The quantity or column of the recording that is used as the distance."""
        return self.header.channel

    @property
    def format(self) -> str:
        """The format family of the recording from which the run was made; empty if there is none."""
        return self.header.format

    @property
    def scene(self) -> Mapping[str, Any] | None:
        """The scene's tables; None if there is no scene."""
        return self.header.scene

    @property
    def traps(self) -> tuple[Trap, ...]:
        """The remarks of the reader on the recording."""
        return tuple(Trap(**plain(trap)) for trap in self.header.traps)

    @property
    def malformed_rows(self) -> int:
        """Number of rows of the recording that were not samples."""
        return self.header.malformed_rows

    @property
    def provenance(self) -> Mapping[str, Any]:
        """Software, configuration and times, as the writer stated them."""
        return self.header.provenance

    def blocks(self, size: int = 1024) -> Iterable[Block]:
        """Return the samples in blocks, which are read on demand.

        Parameters
        ----------
        size : int
            Samples per block; the last may be shorter.

        Returns
        -------
        iterable of Block
            The blocks. They can be iterated more than once while the run is open.

        Raises
        ------
        ValueError
            If ``size`` is not positive.
        RunDamaged
            During iteration, if a chunk cannot be read; and before the blocks of the last chunk, if the checksum of a
            whole column differs.
        """
        if size < 1:
            raise ValueError(f"size must be at least 1 sample, got {size}")
        return _Blocks(self, size)

    def samples(self) -> Block:
        """Return all samples as one block.

        Raises
        ------
        RunDamaged
            If they are damaged.
        """
        header, values = self.header, {}
        for name in (name for name in _BLOCK_COLUMNS if name in header.columns):
            column = self.column(name)
            with reading(self.path, f"the column {name!r} from sample 0"):
                values[name] = column[:]
            self.demand_within(name, values[name], 0)
            self.check(name, hashlib.sha256(values[name].data).hexdigest())
        return _block(header, header.first, values)

    def dataset(self) -> xarray.Dataset:
        """Return the samples as a dataset that reads data on demand.

        Returns
        -------
        xarray.Dataset
            On the dimension ``time``: time (s), distance (m), quality and, if the file has them, distance_errors (m)
            and velocity (m/s), with the file's attributes. The attributes of the dataset are kind, channel, title,
            format and the instrument's name, clock and numbers.

        Raises
        ------
        RunClosed, RunDamaged
            If the run is closed, or the structure of the signal was changed.

        Notes
        -----
        Opening reads the times, because they are the index; other data are read when they are used. A part of a
        column cannot be compared with the digest of the whole column. A flipped bit is still an error (every chunk has
        a checksum, and reading it raises ``OSError``), but an array that was rewritten goes unnoticed.
        :meth:`load_dataset` and :meth:`verify` detect both. After the run is closed, data that were not read are no
        longer available (``KeyError``): use the dataset inside the run's ``with``, or call ``load()`` there. Closing
        the dataset does not close the run.
        """
        return lazy_dataset(self)

    def load_dataset(self) -> xarray.Dataset:
        """Return the samples as a checked dataset in memory, independent of the file.

        Returns
        -------
        xarray.Dataset
            The same content as that of :meth:`dataset`. It needs 25 to 40 bytes per sample and remains usable after
            the run is closed.

        Raises
        ------
        RunClosed, RunDamaged
            If the run is closed, or the samples are damaged.
        """
        return checked_dataset(self, self.samples())

    def originals(self) -> tuple[Original, ...]:
        """Return the original files, bit for bit; an empty tuple if there are none.

        Raises
        ------
        RunDamaged
            If an original file is damaged.
        """
        return tuple(
            Original(entry.name, b"".join(verify.original_pieces(self, entry, start)))
            for entry, start in verify.entries(self)
        )

    def differences(self) -> tuple[RunDamaged, ...]:
        """Read everything again and return an error for each array, original file, field or attribute that differs.

        Returns
        -------
        tuple of RunDamaged
            The errors; empty if the file is undamaged.
        """
        return tuple(verify.differences(self))

    def verify(self, *, but: Iterable[str] = ()) -> None:
        """Read everything again and compare it with its digests.

        Parameters
        ----------
        but : iterable of str
            Columns to leave out, such as those of :data:`CHECKED` after :meth:`samples` has checked them.

        Raises
        ------
        RunDamaged
            For the first array, original file, field or attribute that differs.
        """
        for error in verify.differences(self, but=but):
            raise error


@dataclass(frozen=True, slots=True)
class _Blocks:
    """The samples of a run in blocks, read again in every iteration."""

    run: Run
    size: int

    def __iter__(self) -> Iterator[Block]:
        run, samples = self.run, len(self.run)
        names = [name for name in _BLOCK_COLUMNS if name in run.header.columns]
        columns = {name: run.column(name) for name in names}
        digests = {name: hashlib.sha256() for name in names}
        step = self.size * max(1, CHUNK // self.size)  # read whole blocks, about one chunk at a time
        for start in range(0, samples, step):
            values = {}
            for name in names:
                with reading(run.path, f"the column {name!r} from sample {start}"):
                    run.file()
                    values[name] = columns[name][start : start + step]
                run.demand_within(name, values[name], start)
                digests[name].update(values[name].tobytes())
            if start + step >= samples:
                for name, digest in digests.items():
                    run.check(name, digest.hexdigest())
            read = _block(run.header, run.header.first + start, values)
            for row in range(0, len(read), self.size):
                yield read[row : row + self.size]


_BLOCK_COLUMNS = {
    "time": "t",
    "distance": "distance",
    "quality": "flags",
    "host_mono_ns": "host_ns",
    "velocity": "velocity",
}
CHECKED = tuple(_BLOCK_COLUMNS)
"""The columns of a block, whose digests are checked when all blocks are read."""


def _block(header: Header, first: int, values: Mapping[str, NDArray[Any]]) -> Block:
    fields: dict[str, Any] = {_BLOCK_COLUMNS[n]: array for n, array in values.items() if n in _BLOCK_COLUMNS}
    # Older files do not state the quantity; they contain lengths.
    return Block(first, **fields, quantity=header.quantity or "length", unit=header.unit or "m")
