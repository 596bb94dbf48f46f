"""The container of an xls (OLE, MS-CFB): one stream out of it, and a container with that one stream alone.

A file may say that it has more sectors than bytes, or chain them in a circle; a reader that believes it takes all
memory. Here no chain is longer than the file, and what is written anew has one chain that is right.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

__all__ = ["MAGIC", "Damage", "container_of", "stream_of"]

MAGIC = bytes.fromhex("d0cf11e0a1b11ae1")
_SMALL, _SECTOR, _SHORT, _CUTOFF = 512, 4096, 64, 4096
_FREE, _END, _OF_FAT = 0xFFFFFFFF, 0xFFFFFFFE, 0xFFFFFFFD
_NO_SECTOR = 0xFFFFFFFA  # from here on numbers are marks
_ENTRY = 128
_IN_HEADER = 109  # sectors of the table of chains that the header names itself

U4 = NDArray[np.uint32]


class Damage(ValueError):
    """What is wrong with the file, in a few words."""


def stream_of(data: bytes, names: tuple[str, ...]) -> bytes:
    """Return the stream of the first of some names that a container has.

    Raises
    ------
    Damage
        If it has none, or is no container.
    """
    if len(data) < _SMALL or not data.startswith(MAGIC):
        raise Damage("no header of an OLE file")
    size = {9: 512, 12: 4096}.get(struct.unpack_from("<H", data, 30)[0])
    if size is None:
        raise Damage("sectors of an unknown size")
    first_directory, _, cutoff, first_short = struct.unpack_from("<4I", data, 48)
    chains = _chains(data, size)
    entries = [
        data[at + start : at + start + _ENTRY]
        for at in _places(chains, first_directory, size, len(data))
        for start in range(0, size, _ENTRY)
    ]
    found = [(name, each) for name in names for each in entries if _name(each) == name]
    if not found:
        raise Damage(f"no stream {' or '.join(names)}")
    entry = found[0][1]
    start, length = _start(entry), _length(entry, size)
    if length >= cutoff:
        return _joined(data, chains, start, size, length)
    whole = _joined(data, chains, _start(entries[0]), size, _length(entries[0], size))
    table = np.frombuffer(_joined(data, chains, first_short, size, len(data)), "<u4")
    pieces = [whole[at * _SHORT : at * _SHORT + _SHORT] for at in _followed(table, start)]
    return b"".join(pieces)[:length]


def container_of(stream: bytes) -> bytes:
    """Return a container with one stream, ``Workbook``, which is filled with zeros to whole sectors.

    Examples
    --------
    >>> stream_of(container_of(b"abc" * 3000), ("Workbook",))[:9000] == b"abc" * 3000
    True
    """
    filled = max(-(-len(stream) // _SECTOR), _CUTOFF // _SECTOR)
    tables = 1
    while tables * _SECTOR // 4 < filled + 1 + tables:
        tables += 1
    if tables > _IN_HEADER:
        raise Damage(f"more than {_IN_HEADER * _SECTOR // 4 * _SECTOR} bytes")
    chain = np.full(tables * _SECTOR // 4, _FREE, "<u4")
    chain[: filled - 1] = np.arange(1, filled)
    chain[[filled - 1, filled]] = _END
    chain[filled + 1 : filled + 1 + tables] = _OF_FAT
    header = MAGIC + bytes(16) + struct.pack("<5H6x", 0x3E, 3, 0xFFFE, 12, 6)
    header += struct.pack("<9I", 0, tables, filled, 0, _CUTOFF, _END, 0, _END, 0)
    header += np.arange(filled + 1, filled + 1 + tables, dtype="<u4").tobytes().ljust(4 * _IN_HEADER, b"\xff")
    header = header.ljust(_SECTOR, b"\0")
    directory = _entry("Root Entry", 5, _END, 0, 1) + _entry("Workbook", 2, 0, filled * _SECTOR)
    return header + stream.ljust(filled * _SECTOR, b"\0") + directory.ljust(_SECTOR, b"\0") + chain.tobytes()


def _entry(name: str, kind: int, start: int, length: int, child: int = _FREE) -> bytes:
    text = name.encode("utf-16-le")
    head = text.ljust(64, b"\0") + struct.pack("<HBB3I", len(text) + 2, kind, 1, _FREE, _FREE, child)
    return head + bytes(36) + struct.pack("<IQ", start, length)


def _name(entry: bytes) -> str:
    return entry[:64].decode("utf-16-le", "replace").partition("\0")[0]


def _start(entry: bytes) -> int:
    return int(struct.unpack_from("<I", entry, 116)[0])


def _length(entry: bytes, size: int) -> int:
    return int(struct.unpack_from("<Q" if size > _SMALL else "<I", entry, 120)[0])


def _chains(data: bytes, size: int) -> U4:
    """Return the number of the sector that follows each."""
    header = struct.unpack_from(f"<{_IN_HEADER}I", data, 76)
    tables = [each for each in header if each < _NO_SECTOR]
    following = struct.unpack_from("<I", data, 68)[0]
    for _ in range(len(data) // size + 1):
        if following >= _NO_SECTOR:
            break
        more = np.frombuffer(_sector(data, following, size), "<u4")
        tables += [int(each) for each in more[:-1] if each < _NO_SECTOR]
        following = int(more[-1])
    else:
        raise Damage("its table of sectors runs in a circle")
    if len(tables) > len(data) // size + 1:
        raise Damage("more tables of sectors than sectors")
    return np.frombuffer(b"".join(_sector(data, each, size) for each in tables), "<u4")


def _sector(data: bytes, number: int, size: int) -> bytes:
    sector = data[(number + 1) * size : (number + 2) * size]
    if not sector:
        raise Damage(f"sector {number} lies behind the end")
    return sector.ljust(size, b"\0")  # the last may be cut


def _followed(chains: U4, start: int) -> Iterator[int]:
    """Yield the sectors of a chain, which is no longer than there are sectors."""
    at = start
    for _ in range(chains.size + 1):
        if at >= _NO_SECTOR:
            return
        if at >= chains.size:
            raise Damage(f"sector {at} is in no table")
        yield at
        at = int(chains[at])
    raise Damage("a chain of sectors runs in a circle")


def _places(chains: U4, start: int, size: int, most: int) -> Iterator[int]:
    for each in _followed(chains, start):
        if (each + 1) * size >= most:
            raise Damage(f"sector {each} lies behind the end")
        yield (each + 1) * size


def _joined(data: bytes, chains: U4, start: int, size: int, length: int) -> bytes:
    return b"".join(data[at : at + size] for at in _places(chains, start, size, len(data)))[:length]
