"""A run file against its header: the columns, fields and attributes that no ordinary reading looks at."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from typing import Any

import numpy as np

from storage.errors import damaged, reading
from storage.run_file import layout
from storage.run_file.handle import Contents
from storage.run_file.values import DIMENSION_ATTRIBUTES, stored

__all__ = ["BESIDE_BLOCKS", "attributes", "columns", "fields"]

BESIDE_BLOCKS = ("distance_errors", "sequence")
"""The columns that no block carries."""


def columns(contents: Contents, names: Iterable[str]) -> None:
    """Hold columns, read whole, against their digests; those that the run does not have are left out.

    Raises
    ------
    RunDamaged
    """
    for name in names:
        if name in contents.header.columns:
            with reading(contents.path, f"the column {name!r}"):
                digest = hashlib.sha256(contents.column(name)[:].tobytes())
            contents.check(name, digest.hexdigest())


def fields(contents: Contents) -> None:
    """Hold the scalar fields that other tools see against the header.

    Raises
    ------
    RunDamaged
    """
    for path, value in layout.fields(contents.header).items():
        with reading(contents.path, f"the field {path}"):
            found = contents.file()[path][()]
        _compare(contents, f"the field {path}", found, value)


def attributes(contents: Contents) -> None:
    """Hold the attributes that other tools see against the header: none missing, none added, none changed.

    Raises
    ------
    RunDamaged
    """
    for path, expected in layout.attributes(contents.header).items():
        with reading(contents.path, f"an attribute of {path}"):
            carrier = contents.file()[path].attrs
            found = {name: carrier[name] for name in carrier if name not in DIMENSION_ATTRIBUTES}
        if odd := sorted(set(found) ^ set(expected)):
            state = "is missing" if odd[0] in expected else "was added"
            raise damaged(contents.path, f"the attribute {path}@{odd[0]}", f"it {state}")
        for name, value in expected.items():
            _compare(contents, f"the attribute {path}@{name}", found[name], value)


def _compare(contents: Contents, what: str, found: Any, value: Any) -> None:
    data, dtype = stored(value)
    expected = np.asarray(data, dtype)
    if repr(np.asarray(found).tolist()) != repr(expected.tolist()):
        raise damaged(contents.path, what, f"{expected.tolist()!r} was written, got {found!r}")
