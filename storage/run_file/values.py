"""How a text or number of the header goes into HDF5, for the writer and for whoever checks it afterwards."""

from __future__ import annotations

from typing import Any

import numpy as np

__all__ = ["DIMENSION_ATTRIBUTES", "stored"]

DIMENSION_ATTRIBUTES = frozenset({"CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST"})
"""What HDF5 itself puts on arrays that are tied to a dimension."""


def stored(value: Any) -> tuple[Any, Any]:
    """Return a value as HDF5 is given it, with its type.

    Texts get a fixed length, as netCDF's own library writes them. Texts of free length would lie in HDF5's
    global heap, the one part of the file without a checksum: a flipped bit there changes them unseen, or
    sends the HDF5 library into an endless loop.
    """
    import h5py

    if not isinstance(value, str | tuple):
        return value, None
    texts = [_shown(text).encode() for text in ((value,) if isinstance(value, str) else value)]
    dtype = h5py.string_dtype(length=max(1, *map(len, texts)))
    return (texts[0] if isinstance(value, str) else np.array(texts, dtype)), dtype


def _shown(text: str) -> str:
    """Return a text as HDF5 can hold it, without NUL and lone surrogates; the header holds the exact one."""
    return text.replace("\0", "\ufffd").encode("utf-16", "surrogatepass").decode("utf-16", "replace")
