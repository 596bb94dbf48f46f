"""Write run files whole: :func:`write_run`.

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

import contextlib
import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.block import UNITS, Block
from acquisition.recordings.recording import Original, Trap
from acquisition.source import SourceInfo
from storage.atomic import whole_h5, writing_h5
from storage.run_file import layout
from storage.run_file.arrays import Columns, Originals
from storage.run_file.header import Header, Info, TrapEntry
from storage.run_file.layout import stored
from storage.schema import plain

__all__ = ["RunWriter", "run_writer", "write_run"]


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

    The blocks are written as they arrive, so at most a chunk of 65536 samples and one block are kept in memory.

    Parameters
    ----------
    path : str or PathLike
        The file to create.
    blocks : iterable of Block
        Consecutive blocks. A column that some blocks lack is filled as in :func:`acquisition.block.concatenate`.
    info : SourceInfo
        The source; its ``kind`` is stored with the data.
    originals : sequence of Original
        Files to store bit for bit.
    scene : mapping, optional
        The scene's tables, which JSON must be able to store, with string keys. Tuples are read back as lists.
    title, channel, format : str
        The run's title, the quantity that is used as the distance, and the format family of the recording.
    traps : sequence of Trap
        Remarks of the reader.
    malformed_rows : int
        Number of rows that were not samples.
    provenance : mapping, optional
        Any further information, which JSON must be able to store, with string keys. ``software``, ``version``,
        ``created_utc``, ``start_time`` (ISO 8601, the time of t = 0) and ``configuration`` also become attributes for
        other tools.
    overwrite : bool
        Whether an existing file may be replaced.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    RunExists
        If the file exists and may not be replaced; in this case no block has been read.
    WriteFailed
        If the file cannot be written, blocks are not consecutive or have different quantities, or JSON cannot store
        the scene or the provenance. Errors of the iterable of blocks pass through. In all cases an existing file is
        unchanged.
    """
    with run_writer(path, sigma_m=info.sigma_m, overwrite=overwrite) as run:
        for block in blocks:
            run.append(block)
        run.keep([(original.name, len(original.data)) for original in originals])
        for number, original in enumerate(originals):
            run.take(number, original.data)
        run.finish(
            info,
            title=title,
            channel=channel,
            format=format,
            scene=scene,
            traps=traps,
            malformed_rows=malformed_rows,
            provenance=provenance or {},
        )
    return Path(path)


@contextlib.contextmanager
def run_writer(
    path: str | os.PathLike[str], *, sigma_m: float | None = None, overwrite: bool = False
) -> Iterator[RunWriter]:
    """Yield a writer of a run file, and move the file into place when the ``with`` ends without an error.

    Parameters
    ----------
    path, overwrite
        As in :func:`write_run`.
    sigma_m : float, optional
        Standard deviation of a distance, as stated by the source, m.

    Raises
    ------
    RunExists, WriteFailed
        As in :func:`write_run`.
    """
    path = Path(path)
    with whole_h5(path, overwrite=overwrite, libver=layout.LIBVER) as file:
        run = RunWriter(path, file, sigma_m)
        yield run
        if not run.finished:
            raise ValueError(f"{path}: the run file was not finished; call RunWriter.finish")


class RunWriter:
    """Writes a run file piece by piece with one chunk of samples in memory; made by :func:`run_writer`."""

    def __init__(self, path: Path, file: Any, sigma_m: float | None) -> None:
        self.path, self.finished = path, False
        self._file = file
        self._columns = Columns(path, file, sigma_m)
        self._originals: Originals | None = None

    def append(self, block: Block) -> None:
        """Append the next samples.

        Raises
        ------
        WriteFailed
            If the samples do not follow the previous ones, have another quantity, or cannot be written.
        """
        self._columns.append(block)

    def keep(self, files: Sequence[tuple[str, int]]) -> None:
        """Reserve space for original files of these names and sizes; :meth:`take` appends their bytes."""
        with writing_h5(self.path):
            self._originals = Originals(self._file, files) if files else None

    def take(self, number: int, data: bytes) -> None:
        """Append the next bytes of an original file; ``number`` is its index in the call of :meth:`keep`."""
        assert self._originals is not None
        with writing_h5(self.path):
            self._originals.take(number, data)

    def finish(self, info: SourceInfo, *, traps: Sequence[Trap] = (), **header: Any) -> None:
        """Write the remaining samples and the header.

        Parameters
        ----------
        info : SourceInfo
        traps : sequence of Trap
        **header
            Fields of :class:`storage.run_file.header.Header` that do not follow from the samples and the originals.

        Raises
        ------
        WriteFailed
            If an original is incomplete, or a value of the header is not allowed.
        """
        columns = self._columns
        columns.finish()
        with writing_h5(self.path):
            text = Header(
                info=Info(**plain(info)),
                traps=tuple(TrapEntry(**plain(trap)) for trap in traps),
                first=columns.first or 0,
                samples=columns.rows,
                columns={name: digest.hexdigest() for name, digest in columns.digests.items()},
                originals=() if self._originals is None else self._originals.entries(),
                quantity=columns.quantity,
                unit=UNITS[columns.quantity],
                **header,
            )
            _write_header(self._file, text)
        self.finished = True


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
