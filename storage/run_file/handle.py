"""The open HDF5 file behind a run, with its header: what every way of reading one shares.

HDF5 lets a name lead anywhere: through a soft or an external link to another name or file, to an array whose bytes lie
in other files (external storage) or are put together from them (virtual). A run file is one file, and none of these is
followed: a file from a stranger must not read this machine's others, nor wait for a pipe.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from storage.errors import NotARun, RunClosed, RunDamaged, damaged, one_line, reading
from storage.run_file import layout
from storage.run_file.header import LONGEST_HEADER, MOST_UNWRITTEN, SCHEMA, Header
from storage.run_file.layout import CHUNK
from storage.schema import ValueRefused

__all__ = ["Contents", "open_header"]

FOREIGN = "springmass writes no such file; ask where it comes from"
_COLUMNS = {column.name: column for column in layout.COLUMNS}


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
    unverified : bool
        Whether what does not fit its digest is given all the same.
    """

    path: Path
    handle: Any
    header: Header
    sha256: str
    unverified: bool = False

    def file(self) -> Any:
        """Return the file, if it is open.

        Raises
        ------
        RunClosed
        """
        if not self.handle:
            raise RunClosed(self.path, "an open run was demanded, got a closed one", "read inside its with")
        return self.handle

    def at(self, name: str, what: str) -> Any:
        """Return what stands under a path of the file; ``what`` is what a message calls it.

        Raises
        ------
        RunClosed, RunDamaged
        """
        with reading(self.path, what):
            return self.file()[name]

    def array(self, name: str, dtype: str, length: int, what: str) -> Any:
        """Return an array on disk, its type and length checked.

        Raises
        ------
        RunClosed, RunDamaged
        """
        found, demanded = self.at(name, what), (dtype, (length,))
        with reading(self.path, what):
            is_ = _form(found)
            chunk = max(found.chunks or (0,)) if is_ == demanded else 0
        if is_ != demanded:
            raise damaged(self.path, what, f"type and shape {demanded} were written, got {is_}")
        if chunk > CHUNK:
            raise damaged(self.path, what, f"chunks of at most {CHUNK} values were written, got {chunk}")
        return found

    def column(self, name: str) -> Any:
        """Return a column's array on disk, its type and length checked.

        Raises
        ------
        RunClosed, RunDamaged
        """
        column = _COLUMNS[name]
        return self.array(column.path, column.dtype, self.header.samples, f"the column {name!r}")

    def demand_within(self, name: str, values: Any, start: int) -> None:
        """Hold values of a column, from a sample on, against its range.

        Raises
        ------
        RunDamaged
        """
        try:
            _COLUMNS[name].demand_within(values, start)
        except ValueRefused as error:
            raise RunDamaged(self.path, str(error), FOREIGN) from error

    def demand_own_signal(self) -> None:
        """Refuse arrays beside the columns, and at the root, which other tools would show for them.

        Raises
        ------
        RunClosed, RunDamaged
        """
        signal, root = self.at(layout.SIGNAL, layout.SIGNAL), self.at("/", "/")
        if added := sorted(set(signal) - set(self.header.columns)):
            raise damaged(self.path, f"{layout.SIGNAL}/{added[0]}", "it was added")
        with reading(self.path, "/"):
            for name in root:
                if name not in layout.GROUPS and (name not in signal or root[name] != signal[name]):
                    raise damaged(self.path, f"/{name}", "it is no second name of a column, and was added")

    def check(self, name: str, sha256: str) -> None:
        """Hold a column's digest against the one written.

        Raises
        ------
        RunDamaged
        """
        if sha256 != self.header.columns[name] and not self.unverified:
            raise damaged(self.path, f"the column {name!r}", "its SHA-256 differs")


def open_header(path: Path, *, unverified: bool = False) -> tuple[Any, Header, str]:
    """Open a file that begins as HDF5 does; return it with its header and that one's digest.

    Parameters
    ----------
    path : Path
    unverified : bool
        Whether a header that its digest does not fit may be read.

    Raises
    ------
    NotARun
        If it is HDF5 of another layout.
    RunDamaged
        If it cannot be read, its header is not what was written, or says what no header may.
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
        _demand_own(path, file)
    with reading(path, what):
        if layout.HEADER not in file:
            demand = f"a run file was demanded, got HDF5 without {layout.HEADER}"
            raise NotARun(path, demand, "name a run file, or convert the recording to one")
        stored = file[layout.HEADER]
        if not isinstance(stored, h5py.Dataset):
            raise ValueError(f"a text was written, got a {type(stored).__name__}")
        _demand_text(stored.dtype, stored.shape, LONGEST_HEADER)
        digest = stored.attrs.get_id("sha256")
        _demand_text(digest.dtype, digest.shape, 64)
        text, sha256 = bytes(stored[()]), bytes(stored.attrs["sha256"]).decode()
    if hashlib.sha256(text).hexdigest() != sha256 and not unverified:
        raise damaged(path, what, "its SHA-256 differs")
    try:
        header = Header.decode(text)
    except ValueRefused as error:
        raise RunDamaged(path, str(error), FOREIGN) from error
    except ValueError as error:
        demand = f"a run file of schema {SCHEMA} was demanded, got another ({one_line(error)})"
        raise NotARun(path, demand, "read it with the version of springmass that wrote it") from error
    most, kept = max(MOST_UNWRITTEN, path.stat().st_size), sum(entry.size for entry in header.originals)
    for key, count in (("header.samples", header.samples), ("header.originals, their sizes", kept)):
        if count > most * _PACKED[key]:
            demand = f"{key} must be at most {most * _PACKED[key]} in a file of this size, got {count}"
            raise RunDamaged(path, demand, FOREIGN)
    return header, sha256


MOST_NAMES = 1000
"""Groups and arrays that a file may hold: a run file has some forty."""

_PACKED = {"header.samples": 1, "header.originals, their sizes": 64}
"""How many samples, or bytes of original files, a byte of the file may stand for: text packs well, distances do not."""


def _demand_text(dtype: Any, shape: tuple[int, ...], longest: int) -> None:
    if dtype.kind != "S" or shape != () or dtype.itemsize > longest:
        raise ValueError(f"a text of at most {longest} bytes was written, got {dtype} of shape {shape}")


def _demand_own(path: Path, file: Any) -> None:
    """Go through the whole file without following a name that is not its own; refuse whatever leads out of it."""
    import h5py

    seen, groups, count = set(), [file["/"]], 0
    while groups:
        group = groups.pop()
        count += len(group)
        if count > MOST_NAMES:
            raise damaged(path, group.name, f"at most {MOST_NAMES} names were written")
        for name in group:
            what = f"{group.name.rstrip('/')}/{name}"
            link = group.get(name, getlink=True)
            if not isinstance(link, h5py.HardLink):
                kind = "an external link to another file" if isinstance(link, h5py.ExternalLink) else "a soft link"
                raise damaged(path, what, f"it is {kind}, which is not followed")
            found = group[name]
            if isinstance(found, h5py.Dataset):
                if found.is_virtual:
                    raise damaged(path, what, "it is put together from other arrays (virtual), which is not followed")
                if found.external is not None:
                    raise damaged(path, what, "its bytes lie in another file (external storage), which is not read")
            elif isinstance(found, h5py.Group):
                at = h5py.h5o.get_info(found.id).addr
                if at not in seen:
                    seen.add(at)
                    groups.append(found)


def _form(found: Any) -> tuple[str, tuple[int, ...]]:
    """Return type and shape of an array; of anything else what it is."""
    import h5py

    return (found.dtype.str, found.shape) if isinstance(found, h5py.Dataset) else (type(found).__name__, ())
