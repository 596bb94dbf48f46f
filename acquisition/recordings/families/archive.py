"""A zip archive with recordings: phyphox's CSV export, a packed folder, Tracker's trz.

Each file inside is read by its own format; if there are several, each is a run and the user chooses one. Pictures,
videos and similar files are skipped and listed.
"""

from __future__ import annotations

from acquisition.recordings.parts import contents_of_parts, members
from acquisition.recordings.tables.contents import Contents
from acquisition.recordings.tables.sheet import ColumnFormat

__all__ = ["FORMAT"]

_MAGIC = b"PK\x03\x04"


def _evidence(head: bytes) -> str:
    others = b"[Content_Types].xml" in head or b"xl/" in head or b"application/vnd.oasis" in head[:200]
    return "it begins with the bytes of a zip archive" if head.startswith(_MAGIC) and not others else ""


def _contents(path: str, data: bytes) -> Contents:
    return contents_of_parts(path, members(path, data), "file")


FORMAT = ColumnFormat("zip", "a zip archive of recordings, each a run: phyphox's CSV export", _evidence, _contents)
