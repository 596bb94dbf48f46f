"""Provide an open run file and its header to all ways of reading a run.

In HDF5 a name can lead outside the file: through a soft or external link, or to an array whose bytes are in other
files (external storage, virtual arrays). Run files never need this, so no such reference is followed: opening a file
from a stranger must not read other files of this computer or wait for a pipe.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from storage.errors import NotARun, RunClosed, RunDamaged, damaged, one_line, reading
from storage.run_file import layout
from storage.run_file.header import LONGEST_HEADER, MOST_UNWRITTEN, Header
from storage.run_file.layout import CHUNK
from storage.schema import ValueRefused

__all__ = ["Contents", "open_header"]

FOREIGN = "springmass does not write such files; ask where it comes from"
_COLUMNS = {column.name: column for column in layout.COLUMNS}


@dataclass(frozen=True, slots=True, eq=False)
class Contents:
    """An open run file and its header.

    Parameters
    ----------
    path : Path
        The file.
    handle : h5py.File
        The open file.
    header : Header
        The header of the file.
    sha256 : str
        Digest of the header.
    unverified : bool
        Whether to return data even if their digest differs.
    """

    path: Path
    handle: Any
    header: Header
    sha256: str
    unverified: bool = False

    def file(self) -> Any:
        """Return the open file.

        Raises
        ------
        RunClosed
        """
        if not self.handle:
            raise RunClosed(self.path, "the run is closed", "read it inside its with block")
        return self.handle

    def at(self, name: str, what: str) -> Any:
        """Return the item at a path of the file; ``what`` is its name in messages.

        Raises
        ------
        RunClosed, RunDamaged
        """
        with reading(self.path, what):
            return self.file()[name]

    def array(self, name: str, dtype: str, length: int, what: str) -> Any:
        """Return an array on disk after checking its type and length.

        Raises
        ------
        RunClosed, RunDamaged
        """
        array, expected = self.at(name, what), (dtype, (length,))
        with reading(self.path, what):
            actual = _form(array)
            chunk = max(array.chunks or (0,)) if actual == expected else 0
        if actual != expected:
            raise damaged(self.path, what, f"expected type and shape {expected}, got {actual}")
        if chunk > CHUNK:
            raise damaged(self.path, what, f"expected chunks of at most {CHUNK} values, got {chunk}")
        return array

    def column(self, name: str) -> Any:
        """Return a column's array on disk after checking its type and length.

        Raises
        ------
        RunClosed, RunDamaged
        """
        column = _COLUMNS[name]
        return self.array(column.path, column.dtype, self.header.samples, f"the column {name!r}")

    def demand_within(self, name: str, values: Any, start: int) -> None:
        """Check values of a column, of which the first is that of sample ``start``, against the column's range.

        Raises
        ------
        RunDamaged
        """
        try:
            _COLUMNS[name].demand_within(values, start)
        except ValueRefused as error:
            raise RunDamaged(self.path, str(error), FOREIGN) from error

    def demand_own_signal(self) -> None:
        """Check that the signal and the root contain no additional arrays, which other tools would show instead.

        Raises
        ------
        RunClosed, RunDamaged
        """
        signal, root = self.at(layout.SIGNAL, layout.SIGNAL), self.at("/", "/")
        if extra := sorted(set(signal) - set(self.header.columns)):
            raise damaged(self.path, f"{layout.SIGNAL}/{extra[0]}", "it was added later")
        with reading(self.path, "/"):
            for name in root:
                if name not in layout.GROUPS and (name not in signal or root[name] != signal[name]):
                    raise damaged(self.path, f"/{name}", "it is not a link to a column and was added later")

    def check(self, name: str, sha256: str) -> None:
        """Compare a column's digest with the one in the header.

        Raises
        ------
        RunDamaged
        """
        if sha256 != self.header.columns[name] and not self.unverified:
            raise damaged(self.path, f"the column {name!r}", "checksum mismatch (SHA-256)")


def open_header(path: Path, *, unverified: bool = False) -> tuple[Any, Header, str]:
    """Open a file with the signature of HDF5; return it with its header and the header's digest.

    Parameters
    ----------
    path : Path
    unverified : bool
        Whether to accept a header whose digest differs.

    Raises
    ------
    NotARun
        If the file is HDF5 of another layout.
    RunDamaged
        If the file cannot be read, or its header is damaged or has a value that is not allowed.
    """
    import h5py

    with reading(path, "the file"):
        file = h5py.File(path, "r")
    try:
        return file, *_read_header(path, file, unverified)
    except BaseException:
        file.close()
        raise


def _read_header(path: Path, file: Any, unverified: bool) -> tuple[Header, str]:
    import h5py

    what = "the header"
    with reading(path, "the file"):
        _check_links(path, file)
    with reading(path, what):
        if layout.HEADER not in file:
            problem = f"expected a run file, got HDF5 without {layout.HEADER}"
            raise NotARun(path, problem, "name a run file, or convert the recording to one")
        stored = file[layout.HEADER]
        if not isinstance(stored, h5py.Dataset):
            raise ValueError(f"expected a text, got a {type(stored).__name__}")
        _check_text(stored.dtype, stored.shape, LONGEST_HEADER)
        digest = stored.attrs.get_id("sha256")
        _check_text(digest.dtype, digest.shape, 64)
        text, sha256 = bytes(stored[()]), bytes(stored.attrs["sha256"]).decode()
    if hashlib.sha256(text).hexdigest() != sha256 and not unverified:
        raise damaged(path, what, "checksum mismatch (SHA-256)")
    try:
        header = Header.decode(text)
    except ValueRefused as error:
        raise RunDamaged(path, str(error), FOREIGN) from error
    except ValueError as error:
        problem = f"not a run file that this version reads ({one_line(error)})"
        raise NotARun(path, problem, "read it with the version of springmass that wrote it") from error
    limit, original_bytes = max(MOST_UNWRITTEN, path.stat().st_size), sum(entry.size for entry in header.originals)
    for key, count in (("header.samples", header.samples), ("header.originals, their sizes", original_bytes)):
        if count > limit * _PACKED[key]:
            problem = f"{key} must be at most {limit * _PACKED[key]} for this file size, got {count}"
            raise RunDamaged(path, problem, FOREIGN)
    return header, sha256


MOST_NAMES = 1000
"""Maximum number of groups and arrays; a run file has about forty."""

_PACKED = {"header.samples": 1, "header.originals, their sizes": 64}
"""Maximum number of samples, or of bytes of original files, per byte of a file: only text compresses well."""


def _check_text(dtype: Any, shape: tuple[int, ...], longest: int) -> None:
    if dtype.kind != "S" or shape != () or dtype.itemsize > longest:
        raise ValueError(f"expected a text of at most {longest} bytes, got {dtype} of shape {shape}")


def _check_links(path: Path, file: Any) -> None:
    """Visit the whole file without following links, and refuse every name that may lead out of the file."""
    import h5py

    seen, groups, count = set(), [file["/"]], 0
    while groups:
        group = groups.pop()
        count += len(group)
        if count > MOST_NAMES:
            raise damaged(path, group.name, f"expected at most {MOST_NAMES} names in the file, got more")
        for name in group:
            what = f"{group.name.rstrip('/')}/{name}"
            link = group.get(name, getlink=True)
            if not isinstance(link, h5py.HardLink):
                kind = "an external link to another file" if isinstance(link, h5py.ExternalLink) else "a soft link"
                raise damaged(path, what, f"it is {kind}, which is not followed")
            item = group[name]
            if isinstance(item, h5py.Dataset):
                if item.is_virtual:
                    raise damaged(path, what, "it is a virtual array, which is not followed")
                if item.external is not None:
                    raise damaged(path, what, "its bytes are in another file (external storage), which is not read")
            elif isinstance(item, h5py.Group):
                address = h5py.h5o.get_info(item.id).addr
                if address not in seen:
                    seen.add(address)
                    groups.append(item)


def _form(found: Any) -> tuple[str, tuple[int, ...]]:
    """Return the type and shape of an array; for any other item, return its kind and an empty shape."""
    import h5py

    return (found.dtype.str, found.shape) if isinstance(found, h5py.Dataset) else (type(found).__name__, ())
