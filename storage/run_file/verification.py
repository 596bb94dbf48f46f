"""A run file against its header: every array, original file, field and attribute, each by its name.

Columns and original files are digested as they are read, a chunk at a time: memory does not grow with the run.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from storage.errors import RunDamaged, damaged, reading
from storage.run_file import layout
from storage.run_file.handle import Contents
from storage.run_file.header import FileEntry
from storage.run_file.layout import CHUNK, DIMENSION_ATTRIBUTES, stored

__all__ = ["differences", "entries", "original_pieces"]


def differences(contents: Contents, *, but: Iterable[str] = ()) -> Iterator[RunDamaged]:
    """Yield an error for everything that is not what was written; nothing for a file that verifies.

    Parameters
    ----------
    contents : Contents
    but : iterable of str
        Columns that were held against their digests already.

    Raises
    ------
    RunClosed
    """
    contents = replace(contents, unverified=False)
    header, skipped = contents.header, set(but)
    yield from _caught(_header, contents)
    for name in header.columns:
        if name not in skipped:
            yield from _caught(_column, contents, name)
    for entry, start in entries(contents):
        yield from _caught(_original, contents, entry, start)
    if header.originals:
        yield from _caught(_records, contents)
    yield from _caught(Contents.demand_own_signal, contents)
    for path, value in layout.fields(header).items():
        yield from _caught(_field, contents, path, value)
    for path, expected in layout.attributes(header).items():
        yield from _caught(_attributes, contents, path, expected)


def original_pieces(contents: Contents, entry: FileEntry, start: int) -> Iterator[bytes]:
    """Yield an original file piece by piece, and hold it against its digest at its end.

    Parameters
    ----------
    contents : Contents
    entry : FileEntry
    start : int
        Where its bytes begin.

    Raises
    ------
    RunClosed, RunDamaged
    """
    what = f"the original file {entry.name!r}"
    total = sum(each.size for each in contents.header.originals)
    data = contents.array(f"{layout.WIRE}/bytes", "|u1", total, what)
    digest = hashlib.sha256()
    for at in range(start, start + entry.size, _PIECE):
        with reading(contents.path, what):
            piece = data[at : min(at + _PIECE, start + entry.size)].tobytes()
        digest.update(piece)
        yield piece
    if digest.hexdigest() != entry.sha256 and not contents.unverified:
        raise damaged(contents.path, what, "its SHA-256 differs")


_PIECE = 16 * CHUNK


def entries(contents: Contents) -> Iterator[tuple[FileEntry, int]]:
    """Yield the original files that the header names, each with where its bytes begin."""
    start = 0
    for entry in contents.header.originals:
        yield entry, start
        start += entry.size


def _caught(check: Any, *arguments: Any) -> Iterator[RunDamaged]:
    try:
        check(*arguments)
    except RunDamaged as error:
        yield error


def _header(contents: Contents) -> None:
    stored = contents.at(layout.HEADER, "the header")
    with reading(contents.path, "the header"):
        text = bytes(stored[()])
    if hashlib.sha256(text).hexdigest() != contents.sha256:
        raise damaged(contents.path, "the header", "its SHA-256 differs")


def _column(contents: Contents, name: str) -> None:
    column, digest = contents.column(name), hashlib.sha256()
    for start in range(0, contents.header.samples, _PIECE):
        with reading(contents.path, f"the column {name!r} from sample {start}"):
            values = column[start : start + _PIECE]
        contents.demand_within(name, values, start)
        digest.update(values.tobytes())
    contents.check(name, digest.hexdigest())


def _original(contents: Contents, entry: FileEntry, start: int) -> None:
    for _ in original_pieces(contents, entry, start):
        pass


def _records(contents: Contents) -> None:
    """Hold what says where each original file begins and ends against the header."""
    sizes = np.array([entry.size for entry in contents.header.originals], "<u8")
    for name, expected in layout.records(sizes).items():
        what = f"the array {layout.WIRE}/{name}"
        found = contents.array(f"{layout.WIRE}/{name}", expected.dtype.str, len(expected), what)
        with reading(contents.path, what):
            same = np.array_equal(found[:], expected)
        if not same:
            raise damaged(contents.path, what, "it differs from the header")


def _field(contents: Contents, path: str, value: Any) -> None:
    import h5py

    what = f"the field {path}"
    found = contents.at(path, what)
    with reading(contents.path, what):
        if not isinstance(found, h5py.Dataset):
            raise ValueError(f"a value was written, got a {type(found).__name__}")
        _demand_alike(found, value)
        held = found[()]
    _compare(contents, what, held, value)


def _attributes(contents: Contents, path: str, expected: dict[str, Any]) -> None:
    """Hold the attributes that other tools see against the header: none missing, none added, none changed."""
    carrier = contents.at(path, f"an attribute of {path}")
    with reading(contents.path, f"an attribute of {path}"):
        held = carrier.attrs
        names = {name for name in held if name not in DIMENSION_ATTRIBUTES}
    if odd := sorted(names ^ set(expected)):
        state = "is missing" if odd[0] in expected else "was added"
        raise damaged(contents.path, f"the attribute {path}@{odd[0]}", f"it {state}")
    for name, value in expected.items():
        what = f"the attribute {path}@{name}"
        with reading(contents.path, what):
            _demand_alike(held.get_id(name), value)
            found = held[name]
        _compare(contents, what, found, value)


def _demand_alike(found: Any, value: Any) -> None:
    """Look at type, shape and size before anything is read: free texts lead HDF5 about, and sizes fill the memory."""
    data, dtype = stored(value)
    expected = np.asarray(data, dtype)
    is_, demanded = (found.dtype.kind, found.shape), (expected.dtype.kind, expected.shape)
    if is_ != demanded or found.dtype.itemsize > max(8, expected.dtype.itemsize):
        raise ValueError(f"{_cut(expected.tolist())} was written, got type {found.dtype} of shape {found.shape}")


def _compare(contents: Contents, what: str, found: Any, value: Any) -> None:
    data, dtype = stored(value)
    expected = np.asarray(data, dtype)
    if repr(np.asarray(found).tolist()) != repr(expected.tolist()):
        raise damaged(contents.path, what, f"{_cut(expected.tolist())} was written, got {_cut(found)}")


def _cut(value: Any) -> str:
    """Return a value as Python writes it, not more of it than a line holds."""
    words = repr(value)
    return words if len(words) <= 200 else f"{words[:200]}..."
