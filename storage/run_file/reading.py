"""Run files, read: :func:`open_run` opens one lazily and checks what it reads.

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
    """Tell from a file's first eight bytes whether it may be a run file: whether it is HDF5.

    Whether it is one of ours, :func:`open_run` says.
    """
    return head.startswith(layout.MAGIC)


def open_run(path: str | os.PathLike[str], *, unverified: bool = False) -> Run:
    """Open a run file for reading.

    Parameters
    ----------
    path : str or PathLike
    unverified : bool
        Whether to give what does not fit its digest, to look at it; what differs, :meth:`Run.differences` says.

    Returns
    -------
    Run
        To be used in a ``with``, or closed.

    Raises
    ------
    NotARun
        If nothing is there, or something else.
    RunDamaged
        If the file cannot be read, its header is not what was written, or holds what no header may.
    """
    path = Path(path)
    remedy = "name a run file; springmass formats FILE says what a file is"
    try:
        with open_regular(path) as stream:
            head = stream.read(len(layout.MAGIC))
    except OSError as error:
        raise NotARun(path, f"a run file was demanded, got none ({error.strerror or error})", remedy) from error
    if not is_run(head):
        raise NotARun(path, f"a run file (HDF5) was demanded, got a file that begins with {head!r}", remedy)
    return Run(path, *open_header(path, unverified=unverified), unverified)


class Run(Contents):
    """An open run file.

    What it says of itself is read at once, samples when they are asked for. Nothing is delivered unchecked:
    every chunk carries a checksum, and every column read to its end is held against its SHA-256. Of the ways to the
    samples, :meth:`blocks` and :meth:`dataset` are lazy, :meth:`samples` and :meth:`load_dataset` whole.

    Its ``sha256`` is that of the content: of the header, which holds those of all arrays and original files. Two files
    of the same content have the same, whatever their bytes.
    """

    __slots__ = ()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; again does no harm."""
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
        """The run's title; empty where it has none."""
        return self.header.title

    @property
    def channel(self) -> str:
        """The quantity or column taken as distance."""
        return self.header.channel

    @property
    def format(self) -> str:
        """The family of recordings that read it; empty where none did."""
        return self.header.format

    @property
    def scene(self) -> Mapping[str, Any] | None:
        """The scene's tables; None where none were given."""
        return self.header.scene

    @property
    def traps(self) -> tuple[Trap, ...]:
        """What was seen on reading the old file."""
        return tuple(Trap(**plain(trap)) for trap in self.header.traps)

    @property
    def malformed_rows(self) -> int:
        """Rows of the old file that were not samples."""
        return self.header.malformed_rows

    @property
    def provenance(self) -> Mapping[str, Any]:
        """What the writer said of software, configuration and times."""
        return self.header.provenance

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
        header, values = self.header, {}
        for name in (name for name in _BLOCK_COLUMNS if name in header.columns):
            column = self.column(name)
            with reading(self.path, f"the column {name!r} from sample 0"):
                values[name] = column[:]
            self.demand_within(name, values[name], 0)
            self.check(name, hashlib.sha256(values[name].data).hexdigest())
        return _block(header, header.first, values)

    def dataset(self) -> xarray.Dataset:
        """Return the samples as a dataset that reads what is asked for, when it is asked for.

        Returns
        -------
        xarray.Dataset
            On the dimension ``time``: time (s), distance (m), quality, and where the file has them
            distance_errors (m) and velocity (m/s), with the file's attributes. Its own attributes are kind,
            channel, title, format and the instrument's name, clock and numbers.

        Raises
        ------
        RunClosed, RunDamaged
            If the run is closed, or the signal's structure is not what was written.

        Notes
        -----
        Opening reads the times, for they are the index; of the rest, memory holds only the part looked at. A
        part cannot be held against the digest of the whole: a flipped bit is still an error (every chunk
        carries a checksum, and reading it raises ``OSError``), an array that someone rewrote is not.
        :meth:`load_dataset` finds both, and :meth:`verify` does so once for many readings. What has not been
        read when the run is closed cannot be read any more (``KeyError``): use the dataset inside the run's
        ``with``, or ``load()`` it there. Closing the dataset leaves the run open.
        """
        return lazy_dataset(self)

    def load_dataset(self) -> xarray.Dataset:
        """Return the samples as a dataset in memory, checked and free of the file.

        Returns
        -------
        xarray.Dataset
            The same as :meth:`dataset`. It takes 25 to 40 bytes a sample and outlives the run.

        Raises
        ------
        RunClosed, RunDamaged
            If the run is closed, or the samples are not what was written.
        """
        return checked_dataset(self, self.samples())

    def originals(self) -> tuple[Original, ...]:
        """Return the original files, bit for bit; none where none were kept.

        Raises
        ------
        RunDamaged
            If one is not what was written.
        """
        return tuple(
            Original(entry.name, b"".join(verify.original_pieces(self, entry, start)))
            for entry, start in verify.entries(self)
        )

    def differences(self) -> tuple[RunDamaged, ...]:
        """Read everything again and return an error for each thing that is not what was written.

        Returns
        -------
        tuple of RunDamaged
            Naming the array, original file, field or attribute; empty for a file that verifies.
        """
        return tuple(verify.differences(self))

    def verify(self, *, but: Iterable[str] = ()) -> None:
        """Read everything again and hold it against what was written.

        Parameters
        ----------
        but : iterable of str
            Columns to leave out, such as :data:`CHECKED`, which :meth:`samples` has held against their digests.

        Raises
        ------
        RunDamaged
            Naming the first array, original file, field or attribute that differs.
        """
        for error in verify.differences(self, but=but):
            raise error


@dataclass(frozen=True, slots=True)
class _Blocks:
    """The samples of a run in blocks, anew at every iteration."""

    run: Run
    size: int

    def __iter__(self) -> Iterator[Block]:
        run, samples = self.run, len(self.run)
        names = [name for name in _BLOCK_COLUMNS if name in run.header.columns]
        columns = {name: run.column(name) for name in names}
        digests = {name: hashlib.sha256() for name in names}
        step = self.size * max(1, CHUNK // self.size)  # whole blocks, about a chunk at a time
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
"""The columns that make blocks: whoever reads these to their end has them checked."""


def _block(header: Header, first: int, values: Mapping[str, NDArray[Any]]) -> Block:
    fields: dict[str, Any] = {_BLOCK_COLUMNS[n]: array for n, array in values.items() if n in _BLOCK_COLUMNS}
    # Files from before the quantity was written hold lengths.
    return Block(first, **fields, quantity=header.quantity or "length", unit=header.unit or "m")
