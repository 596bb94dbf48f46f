"""A zip archive with recordings: phyphox's CSV export, a packed folder, Tracker's trz.

Each file inside is read by its own format; if there are several, each is a run and the user chooses one. Pictures,
videos and similar files are skipped and listed.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from acquisition.recordings.identify import formats
from acquisition.recordings.parts import members, tables_of_parts
from acquisition.recordings.tables.format import ColumnFormat
from acquisition.recordings.tables.table import Table
from acquisition.recordings.tables.text import HEAD_BYTES

_MAGIC = b"PK\x03\x04"
_CONTAINERS = ("workbook", "zip")


def _evidence(head: bytes) -> str:
    others = b"[Content_Types].xml" in head or b"xl/" in head or b"application/vnd.oasis" in head[:200]
    return "it begins with the bytes of a zip archive" if head.startswith(_MAGIC) and not others else ""


def _tables(path: str, data: bytes) -> list[Table]:
    families = [each for each in formats() if isinstance(each, ColumnFormat) and each.name not in _CONTAINERS]

    def reader(name: str, data: bytes) -> Callable[[], list[Table]] | None:
        family = next((each for each in families if each.recognises(data[:HEAD_BYTES])), None)
        return None if family is None else partial(family.tables, f"{path}, file {name}", data)

    return tables_of_parts(path, ((name, reader(name, part)) for name, part in members(path, data)), "file")


FORMAT = ColumnFormat("zip", "a zip archive of recordings, each a run: phyphox's CSV export", _evidence, _tables)
