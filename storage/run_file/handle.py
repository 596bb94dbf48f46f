"""The open HDF5 file behind a run, with its header: what every way of reading one shares."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from storage.errors import NotARun, RunClosed, damaged, one_line, reading
from storage.run_file import layout
from storage.run_file.header import SCHEMA, Header

__all__ = ["Contents", "open_header"]


@dataclass(frozen=True, slots=True, eq=False)
class Contents:
    """An open run file and what it says of itself.

    Parameters
    ----------
    path : Path
        The file.
    handle : h5py.File
        The same, open.
    header : Header
        Its header, its own digest checked.
    sha256 : str
        That digest.
    """

    path: Path
    handle: Any
    header: Header
    sha256: str

    def file(self) -> Any:
        """Return the file, if it is open.

        Raises
        ------
        RunClosed
        """
        if not self.handle:
            raise RunClosed(self.path, "an open run was demanded, got a closed one", "read inside its with")
        return self.handle

    def column(self, name: str) -> Any:
        """Return a column's array on disk, its type and length checked.

        Raises
        ------
        RunClosed, RunDamaged
        """
        column = next(column for column in layout.COLUMNS if column.name == name)
        what = f"the column {name!r}"
        with reading(self.path, what):
            found = self.file()[column.path]
            is_, demanded = (found.dtype.str, found.shape), (column.dtype, (self.header.samples,))
        if is_ != demanded:
            raise damaged(self.path, what, f"type and shape {demanded} were written, got {is_}")
        return found

    def check(self, name: str, sha256: str) -> None:
        """Hold a column's digest against the one written.

        Raises
        ------
        RunDamaged
        """
        if sha256 != self.header.columns[name]:
            raise damaged(self.path, f"the column {name!r}", "its SHA-256 differs")


def open_header(path: Path) -> tuple[Any, Header, str]:
    """Open a file that begins as HDF5 does; return it with its header and that one's digest.

    Raises
    ------
    NotARun
        If it is HDF5 of another layout.
    RunDamaged
        If it cannot be read, or its header is not what was written.
    """
    import h5py

    with reading(path, "the file"):
        file = h5py.File(path, "r")
    try:
        return file, *_read_header(path, file)
    except BaseException:
        file.close()
        raise


def _read_header(path: Path, file: Any) -> tuple[Header, str]:
    what = "the header"
    with reading(path, what):
        if layout.HEADER not in file:
            demand = f"a run file was demanded, got HDF5 without {layout.HEADER}"
            raise NotARun(path, demand, "name a run file, or convert the recording to one")
        stored = file[layout.HEADER]
        text, sha256 = bytes(stored[()]), bytes(stored.attrs["sha256"]).decode()
    if hashlib.sha256(text).hexdigest() != sha256:
        raise damaged(path, what, "its SHA-256 differs")
    try:
        return Header.decode(text), sha256
    except (KeyError, TypeError, ValueError) as error:
        demand = f"a run file of schema {SCHEMA} was demanded, got another ({one_line(error)})"
        raise NotARun(path, demand, "read it with the version of springmass that wrote it") from error
