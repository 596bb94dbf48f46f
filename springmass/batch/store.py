"""Rows on the disk: parts, each whole by rename, and one file of all when the course is done.

A part is JSON lines: nothing to install, read by DuckDB and pandas too, and numbers come back bit for bit.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from io import BufferedReader
from pathlib import Path
from typing import Any, Literal

from acquisition.regular_file import open_regular, read_regular
from springmass.batch.rows import dumped
from springmass.errors import USAGE, ProgramError
from storage.atomic import remove_leftovers, whole_file, write_whole, writing

if sys.platform != "win32":
    import fcntl

__all__ = ["Store", "demand_course", "key_of"]

WHOLE = "whole.jsonl"
MARK = "complete.json"
_LOCK = "lock"
_Place = tuple[Path, int, int]


def key_of(row: Mapping[str, Any]) -> str:
    """Return what tells a row's run from others, as :attr:`springmass.batch.plan.Job.key`."""
    job = row["job"]
    which = [job["answers"].get(name) for name in ("run", "channel")]
    return dumped([job["path"], *which]) if any(which) else str(job["path"])


class Store:
    """The rows of a course in its folder's ``parts``.

    Parameters
    ----------
    folder : Path
        Of the course; made where it is not there.

    Raises
    ------
    storage.errors.WriteFailed
        Of every method that writes, if it cannot.
    """

    def __init__(self, folder: Path) -> None:
        self.parts = folder / "parts"
        self._places: dict[str, list[_Place]] = {}
        self.damaged = 0

    @contextlib.contextmanager
    def held(self, how: Literal["alone", "with others"]) -> Iterator[None]:
        """Hold the folder for one pass, alone or beside other shards.

        Raises
        ------
        ProgramError
            With exit code 2 if another pass is at work there.
        """
        with writing(self.parts):
            self.parts.mkdir(parents=True, exist_ok=True)
        if sys.platform == "win32":  # nothing holds two passes apart
            yield
            return
        with writing(self.parts / _LOCK):
            file = (self.parts / _LOCK).open("ab")
        with file as lock:
            wanted = fcntl.LOCK_EX if how == "alone" else fcntl.LOCK_SH
            try:
                fcntl.flock(lock, wanted | fcntl.LOCK_NB)
            except BlockingIOError as error:
                demand = "a folder of results for this pass alone was demanded, another is at work on it"
                raise ProgramError(f"{self.parts.parent}: {demand}; wait for its end", USAGE) from error
            except OSError:
                pass  # a network disk without locks
            yield

    def read(self) -> None:
        """Learn where each row lies; the file of all first, so that a part's row comes after an older one."""
        self._places.clear()
        self.damaged = 0
        remove_leftovers(self.parts)
        for path in self._files():
            for place, row in _lines(path):
                if row is None:
                    self.damaged += 1
                else:
                    self._places.setdefault(key_of(row), []).append(place)

    def rows(self, key: str) -> Iterator[dict[str, Any]]:
        """Yield the rows of a run, the latest first."""
        for path, offset, size in reversed(self._places.get(key, ())):
            with open_regular(path) as file:
                file.seek(offset)
                yield json.loads(file.read(size) or b"")

    def all(self) -> Iterator[dict[str, Any]]:
        """Yield every row that stands there, file by file."""
        for path in self._files():
            yield from (row for _, row in _lines(path) if row is not None)

    def paths(self) -> set[str]:
        """Return the paths of all runs that it has a row of."""
        return {json.loads(key)[0] if key.startswith("[") else key for key in self._places}

    def add(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Write rows as a part, whole or not at all."""
        lines = [_line(row) for row in rows]
        data = b"".join(lines)
        path = write_whole(self.parts / f"part-{hashlib.sha256(data).hexdigest()[:16]}.jsonl", data)
        offset = 0
        for row, line in zip(rows, lines, strict=True):
            self._places.setdefault(key_of(row), []).append((path, offset, len(line)))
            offset += len(line)

    def put_together(self, rows: Iterable[dict[str, Any]]) -> Iterator[dict[str, Any]]:
        """Write the file of all rows, in this order, and yield each when it is written.

        After the last one they are read from that file, and the parts are gone; who stops before it leaves all as it
        was.
        """
        whole, offset = self.parts / WHOLE, 0
        places: dict[str, list[_Place]] = {}
        with whole_file(whole) as temporary, writing(whole), temporary.open("wb") as file:
            for row in rows:
                line = _line(row)
                file.write(line)
                places.setdefault(key_of(row), []).append((whole, offset, len(line)))
                offset += len(line)
                yield row
        self._places = places
        for path in self._files():
            if path != whole:
                with writing(path):
                    path.unlink(missing_ok=True)

    def mark(self, told: Mapping[str, Any]) -> None:
        """Say that all was made of this; before it changes, it is to be taken away by :meth:`unmark`."""
        write_whole(self.parts / MARK, f"{dumped(told)}\n")

    def unmark(self) -> None:
        """Say that not all may be made."""
        with writing(self.parts / MARK):
            (self.parts / MARK).unlink(missing_ok=True)

    def marked(self) -> Mapping[str, Any] | None:
        """Return what all was made of, None where it may not be."""
        try:
            told = json.loads(read_regular(self.parts / MARK))
        except (OSError, ValueError):
            return None
        return told if isinstance(told, dict) and self._files() == [self.parts / WHOLE] else None

    def _files(self) -> list[Path]:
        if not self.parts.is_dir():
            return []
        named = sorted(path for path in self.parts.glob("part-*.jsonl"))
        whole = self.parts / WHOLE
        return [whole, *named] if whole.is_file() else named


def _line(row: Mapping[str, Any]) -> bytes:
    return f"{dumped(row)}\n".encode("utf-8", "backslashreplace")


def _lines(path: Path) -> Iterator[tuple[_Place, dict[str, Any] | None]]:
    """Yield where each line lies and its row, None where it is none."""
    offset = 0
    with BufferedReader(open_regular(path)) as file:
        for line in file:
            try:
                row = json.loads(line)
                key_of(row)
            except (ValueError, KeyError, TypeError, AttributeError):
                row = None
            yield (path, offset, len(line)), row
            offset += len(line)


def demand_course(folder: str | os.PathLike[str]) -> Store:
    """Return the store of a course's folder, read.

    Raises
    ------
    ProgramError
        With exit code 2 if it holds none.
    """
    store = Store(Path(folder))
    if not store.parts.is_dir():
        demand = "a folder of results that springmass batch made was demanded, got another"
        raise ProgramError(f"{folder}: {demand}; name that of its -o", USAGE)
    store.read()
    return store
