"""Files that are no recording of a family read here, and what a user can do about each."""

from __future__ import annotations

from collections.abc import Callable

from acquisition.errors import FormatError, UnknownFormat
from acquisition.recordings.tables.text import head_lines

__all__ = ["refuse"]

_TEXT = 'export time and position as text, tab separated, under a line "Time (s)<TAB>Distance (m)"'
_AS_CSV = 'export the data as text: in phyphox "Export data", then "CSV (Comma, decimal point)"; in a spreadsheet "CSV"'
_ZIP = b"PK\x03\x04"


def _is_hdf5(head: bytes) -> bool:
    return any(head[at : at + 8] == b"\x89HDF\r\n\x1a\n" for at in (0, 512, 1024, 2048, 4096))


def _is_xlsx(head: bytes) -> bool:
    return head.startswith(_ZIP) and (b"[Content_Types].xml" in head or b"xl/" in head)


def _begins(with_bytes: bytes) -> Callable[[bytes], bool]:
    return lambda head: head.startswith(with_bytes)


_FAMILIES = (
    ("an HDF5 file", _is_hdf5, "if it is a run file, open it as a run; it is not an old recording"),
    ("an Excel workbook (xlsx)", _is_xlsx, _AS_CSV),
    ("an Excel workbook (xls)", _begins(bytes.fromhex("d0cf11e0a1b11ae1")), _AS_CSV),
    ("a zip archive", _begins(_ZIP), "unpack it and name a file inside, a CSV of phyphox say"),
    ("a TDMS index", _begins(b"TDSh"), "name the .tdms file beside it"),
)


def refuse(path: str, head: bytes, names: tuple[str, ...]) -> FormatError:
    """Return the error for a file that no format recognises.

    Parameters
    ----------
    path : str
    head : bytes
        The start of the file.
    names : tuple of str
        The formats that were tried.

    Returns
    -------
    UnknownFormat
        Naming what the file is where that is known.
    """
    for title, matches, remedy in _FAMILIES:
        if matches(head):
            return UnknownFormat(path, f"expected a recording, got {title}", remedy)
    if not "".join(head_lines(head)).strip("\0 \t"):
        return UnknownFormat(path, "expected a recording, got binary data or nothing", _TEXT)
    if head.count(b"\n") + head.count(b"\r") == 0 and len(head) > 4096:
        return UnknownFormat(path, "expected lines of text, got one line without end", _TEXT)
    return UnknownFormat(path, f"no format recognises it (tried {', '.join(names)})", _TEXT)
