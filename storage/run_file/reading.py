"""Read run files: :func:`open_run` opens one lazily and checks what it reads.

In HDF5 a name can lead outside the file: through a soft or external link, or to an array whose bytes are in other
files. Run files never need this, so no such name is followed: opening a file from a stranger must not read other files
of this computer or wait for a pipe.
"""

from __future__ import annotations

import hashlib
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Self

from numpy.typing import NDArray

from acquisition.block import Block, SourceInfo
from acquisition.recordings.recording import FormatIssue, Original, Recording
from acquisition.regular_file import open_regular
from storage.errors import NotARun, RunClosed, RunDamaged, one_line
from storage.hdf5 import damaged, reading_h5
from storage.run_file import layout
from storage.run_file.header import FileEntry, RunHeader
from storage.run_file.layout import CHECKED, CHUNK
from storage.schema import ValueRefused, plain

_PIECE = 16 * CHUNK


def open_run(path: str | os.PathLike[str], *, unverified: bool = False) -> RunFile:
    """Open a run file for reading; use it in a ``with``, or close it. See :class:`RunFile`."""
    return RunFile(path, unverified=unverified)


def may_be_run(path: str | os.PathLike[str]) -> bool:
    """Return whether an HDF5 file is a run file, perhaps a damaged one, and not one of another program."""
    import h5py

    try:
        with h5py.File(path) as file:
            return "entry" in file or not any(isinstance(item, h5py.Dataset) for item in file.values())
    except (OSError, KeyError, RuntimeError):
        return True


class RunFile:
    """An open run file.

    The header is read when the file is opened, samples on demand. Everything is checked: every chunk has a checksum,
    and every column that is read is compared with its SHA-256. Every method raises RunDamaged for the first
    damage that it finds, and RunClosed after the run was closed.

    ``sha256`` is the digest of the header, which contains the digests of all arrays and original files. Two files with
    the same content therefore have the same ``sha256``, even if their bytes differ.

    With ``unverified``, data are returned even if their digest differs; :meth:`differences` lists the differences.
    Raises NotARun if the file is missing or no run file, RunDamaged if it cannot be read, and RunOpen if another
    program has it open for writing.
    """

    def __init__(self, path: str | os.PathLike[str], *, unverified: bool = False) -> None:
        import h5py

        self.path, self.unverified = Path(path), unverified
        _demand_hdf5(self.path)
        with reading_h5(self.path, "the file"):
            self._file = h5py.File(self.path, "r")
        try:
            self.header, self.sha256 = self._read_header()
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file. Further calls do nothing."""
        self._file.close()

    def __len__(self) -> int:
        """Return the number of samples."""
        return self.header.samples

    @property
    def info(self) -> SourceInfo:
        """The source."""
        return SourceInfo(**plain(self.header.info))

    @property
    def traps(self) -> tuple[FormatIssue, ...]:
        """The remarks of the reader on the recording."""
        return tuple(FormatIssue(**plain(trap)) for trap in self.header.traps)

    @property
    def provenance(self) -> Mapping[str, Any]:
        """Software, configuration and times, as the writer stated them."""
        return self.header.provenance

    def samples(self) -> Block:
        """Return all samples as one block."""
        values = self._rows(0, len(self))
        for name, array in values.items():
            digest = hashlib.sha256(array.data)
            self._compare(f"the column {name!r}", digest, self.header.columns[name], strict=False)
        fields: dict[str, Any] = {layout.BY_NAME[name].field: array for name, array in values.items()}
        # Older files do not state the quantity; they contain lengths.
        quantity, unit = self.header.quantity or "length", self.header.unit or "m"
        return Block(self.header.first, **fields, quantity=quantity, unit=unit)

    def recording(self) -> Recording:
        """Return the recording, without the original files, which :meth:`originals` reads."""
        header = self.header
        return Recording(
            header.format,
            str(self.path),
            self.info,
            header.channel,
            self.samples(),
            self.traps,
            header.malformed_rows,
            title=header.title,
        )

    def originals(self) -> tuple[Original, ...]:
        """Return the original files, bit for bit; an empty tuple if there are none."""
        return tuple(Original(entry.name, b"".join(self._original(entry, at))) for entry, at in self._entries())

    def differences(self) -> tuple[RunDamaged, ...]:
        """Read everything again; return an error for the header and each column or original file that differs."""
        return tuple(self._differences(()))

    def verify(self, *, but: Iterable[str] = ()) -> None:
        """Read header, columns and original files again and compare them with their digests."""
        for error in self._differences(but):
            raise error

    def _differences(self, but: Iterable[str]) -> Iterator[RunDamaged]:
        checks: list[Callable[[], object]] = [partial(self._header_text, strict=True)]
        checks += [partial(self._check_column, name) for name in self.header.columns if name not in {*but}]
        checks += [partial(deque, self._original(*entry, strict=True), maxlen=0) for entry in self._entries()]
        for check in checks:
            try:
                check()
            except RunDamaged as error:
                yield error

    def _read_header(self) -> tuple[RunHeader, str]:
        text, sha256 = self._header_text()
        try:
            return RunHeader.decode(text), sha256
        except ValueRefused as error:
            remedy = "springmass does not write such files; ask where it comes from"
            raise RunDamaged(self.path, str(error), remedy) from error
        except ValueError as error:
            problem = f"not a run file that this version reads ({one_line(error)})"
            raise NotARun(self.path, problem, "read it with the version of springmass that wrote it") from error

    def _header_text(self, *, strict: bool = False) -> tuple[bytes, str]:
        """Return the text of the header and its digest."""
        what = "the header"
        stored = self._array(layout.HEADER, what)
        with reading_h5(self.path, what):
            digest = stored.attrs.get_id("sha256")
            if (stored.dtype.kind, stored.shape, digest.dtype.kind, digest.shape) != ("S", (), "S", ()):
                raise ValueError("expected a text with its digest")
            text, sha256 = bytes(stored[()]), bytes(stored.attrs["sha256"]).decode()
        self._compare(what, hashlib.sha256(text), sha256, strict=strict)
        return text, sha256

    def _compare(self, what: str, digest: Any, sha256: str, *, strict: bool) -> None:
        if digest.hexdigest() != sha256 and (strict or not self.unverified):
            raise damaged(self.path, what, "checksum mismatch (SHA-256)")

    def _array(self, path: str, what: str) -> Any:
        """Return an array of the file after checking that its name and its bytes do not lead to another file."""
        import h5py

        if not self._file:
            raise RunClosed(self.path, "the run is closed", "read it inside its with block")
        with reading_h5(self.path, what):
            item = self._file
            for name in path.strip("/").split("/"):
                link = item.get(name, getlink=True) if isinstance(item, h5py.Group) else None
                if link is None and path == layout.HEADER:
                    problem = f"expected a run file, got HDF5 without {layout.HEADER}"
                    raise NotARun(self.path, problem, "name a run file, or convert the recording to one")
                if not isinstance(link, h5py.HardLink):
                    kind = "missing" if link is None else "a link that leads elsewhere, which is not followed"
                    raise damaged(self.path, what, f"{name!r} is {kind}")
                item = item[name]
            if not isinstance(item, h5py.Dataset):
                raise ValueError(f"expected an array, got a {type(item).__name__}")
            if item.is_virtual or item.external is not None:
                raise damaged(self.path, what, "its bytes are in another file, which is not read")
        return item

    def _sized(self, path: str, dtype: str, length: int, what: str) -> Any:
        array = self._array(path, what)
        if (array.dtype.str, array.shape) != (dtype, (length,)):
            how = f"expected type and shape {dtype, (length,)}, got {array.dtype.str, array.shape}"
            raise damaged(self.path, what, how)
        return array

    def _rows(self, start: int, stop: int, names: Iterable[str] = CHECKED) -> dict[str, NDArray[Any]]:
        """Return the values of some samples by column."""
        values = {}
        for name in (name for name in names if name in self.header.columns):
            what, column = f"the column {name!r}", layout.BY_NAME[name]
            array = self._sized(column.path, column.dtype, len(self), what)
            with reading_h5(self.path, f"{what} from sample {start}"):
                values[name] = array[start:stop]
        return values

    def _check_column(self, name: str) -> None:
        digest = hashlib.sha256()
        if name not in layout.BY_NAME:
            raise damaged(self.path, f"the column {name!r}", "this version does not know it")
        for start in range(0, len(self), _PIECE):
            digest.update(self._rows(start, start + _PIECE, [name])[name].tobytes())
        self._compare(f"the column {name!r}", digest, self.header.columns[name], strict=True)

    def _entries(self) -> Iterator[tuple[FileEntry, int]]:
        """Yield each original file in the header with the index of its first byte."""
        start = 0
        for entry in self.header.originals:
            yield entry, start
            start += entry.size

    def _original(self, entry: FileEntry, start: int, *, strict: bool = False) -> Iterator[bytes]:
        """Yield an original file in pieces, and compare its digest at the end."""
        what, digest = f"the original file {entry.name!r}", hashlib.sha256()
        data = self._sized(f"{layout.WIRE}/bytes", "|u1", sum(each.size for each in self.header.originals), what)
        stop = start + entry.size
        for at in range(start, stop, _PIECE):
            with reading_h5(self.path, what):
                piece = data[at : min(at + _PIECE, stop)].tobytes()
            digest.update(piece)
            yield piece
        self._compare(what, digest, entry.sha256, strict=strict)


def _demand_hdf5(path: Path) -> None:
    remedy = "name a run file of springmass"
    try:
        with open_regular(path) as stream:
            head = stream.read(len(layout.HDF5_MAGIC))
    except OSError as error:
        raise NotARun(path, f"the run file cannot be opened ({error.strerror or error})", remedy) from error
    if head != layout.HDF5_MAGIC:
        raise NotARun(path, f"expected a run file (HDF5), got a file that begins with {head!r}", remedy)
