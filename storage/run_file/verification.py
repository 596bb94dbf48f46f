"""Compare every array, original file, field and attribute of a run file with its header.

Columns and original files are read and digested in chunks, so memory does not grow with the run.
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
    """Yield an error for each difference between a file and its header; yield nothing for an undamaged file.

    Parameters
    ----------
    contents : Contents
    but : iterable of str
        Columns that have already been checked.

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
    """Yield an original file in pieces, and compare its digest at the end.

    Parameters
    ----------
    contents : Contents
    entry : FileEntry
    start : int
        Index of the file's first byte.

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
        raise damaged(contents.path, what, "checksum mismatch (SHA-256)")


_PIECE = 16 * CHUNK


def entries(contents: Contents) -> Iterator[tuple[FileEntry, int]]:
    """Yield each original file in the header with the index of its first byte."""
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
        raise damaged(contents.path, "the header", "checksum mismatch (SHA-256)")


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
    """Compare the arrays that locate the original files with the header."""
    sizes = np.array([entry.size for entry in contents.header.originals], "<u8")
    for name, expected in layout.records(sizes).items():
        what = f"the array {layout.WIRE}/{name}"
        array = contents.array(f"{layout.WIRE}/{name}", expected.dtype.str, len(expected), what)
        with reading(contents.path, what):
            same = np.array_equal(array[:], expected)
        if not same:
            raise damaged(contents.path, what, "it differs from the header")


def _field(contents: Contents, path: str, value: Any) -> None:
    import h5py

    what = f"the field {path}"
    field = contents.at(path, what)
    with reading(contents.path, what):
        if not isinstance(field, h5py.Dataset):
            raise ValueError(f"expected a value, got a {type(field).__name__}")
        _check_form(field, value)
        actual = field[()]
    _compare(contents, what, actual, value)


def _attributes(contents: Contents, path: str, expected: dict[str, Any]) -> None:
    """Check that the attributes for other tools match the header: none is missing, added or changed."""
    carrier = contents.at(path, f"an attribute of {path}")
    with reading(contents.path, f"an attribute of {path}"):
        attributes = carrier.attrs
        names = {name for name in attributes if name not in DIMENSION_ATTRIBUTES}
    if different := sorted(names ^ set(expected)):
        state = "is missing" if different[0] in expected else "was added later"
        raise damaged(contents.path, f"the attribute {path}@{different[0]}", f"it {state}")
    for name, value in expected.items():
        what = f"the attribute {path}@{name}"
        with reading(contents.path, what):
            _check_form(attributes.get_id(name), value)
            actual = attributes[name]
        _compare(contents, what, actual, value)


def _check_form(stored_item: Any, value: Any) -> None:
    """Check type, shape and size before reading: variable-length texts can hang HDF5, large ones fill the memory."""
    data, dtype = stored(value)
    expected = np.asarray(data, dtype)
    actual, required = (stored_item.dtype.kind, stored_item.shape), (expected.dtype.kind, expected.shape)
    if actual != required or stored_item.dtype.itemsize > max(8, expected.dtype.itemsize):
        found = f"type {stored_item.dtype} of shape {stored_item.shape}"
        raise ValueError(f"expected {_cut(expected.tolist())}, got {found}")


def _compare(contents: Contents, what: str, actual: Any, value: Any) -> None:
    data, dtype = stored(value)
    expected = np.asarray(data, dtype)
    if repr(np.asarray(actual).tolist()) != repr(expected.tolist()):
        raise damaged(contents.path, what, f"expected {_cut(expected.tolist())}, got {_cut(actual)}")


def _cut(value: Any) -> str:
    """Return the repr of a value, cut after 200 characters."""
    words = repr(value)
    return words if len(words) <= 200 else f"{words[:200]}..."
