"""The store of a course: one SQLite file, which only the process that runs the course opens.

Rows are added in batches of one transaction each, so after a crash a row is whole or absent. SQLite's own locks are
off: a lock on ``course.lock`` keeps a second pass out, and that file names the process that holds it.
"""

import contextlib
import json
import os
import platform
import sqlite3
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from springmass.errors import LOG, UNREADABLE, ProgramError
from springmass.loading.save import now_utc
from storage.atomic import writing
from storage.errors import WriteFailed
from storage.locks import lock

DATABASE, LOCK = "course.db", "course.lock"
_TABLE = "CREATE TABLE IF NOT EXISTS runs (key TEXT PRIMARY KEY, made_of TEXT, row TEXT)"


class Store:
    """The rows of a course; ``key`` is what a run is called, ``made_of`` a digest of all on which its row depends."""

    def __init__(self, folder: Path) -> None:
        self._path = (folder / DATABASE).absolute()
        with self._errors():
            uri = f"{self._path.as_uri()}?nolock={int(sys.platform != 'win32')}"
            self._db = sqlite3.connect(uri, uri=True, timeout=0.0, isolation_level=None)
        with self._errors():
            self._db.execute("PRAGMA locking_mode = EXCLUSIVE")
            self._db.execute(_TABLE)

    def close(self) -> None:
        """Close the file."""
        self._db.close()

    def made_of(self) -> dict[str, str]:
        """Return by key what each row was made of."""
        with self._errors():
            return dict(self._db.execute("SELECT key, made_of FROM runs"))

    def rows(self, keys: Iterable[str]) -> Iterator[dict[str, Any]]:
        """Yield the rows of these keys, in this order."""
        with self._errors():
            for key in keys:
                for (row,) in self._db.execute("SELECT row FROM runs WHERE key = ?", (key,)):
                    yield json.loads(row)

    def add(self, rows: Iterable[tuple[str, str, Mapping[str, Any]]]) -> None:
        """Store rows, each with its key and what it was made of, in one transaction."""
        values = [(key, made_of, json.dumps(row, allow_nan=False)) for key, made_of, row in rows]
        with self._errors(), self._db:  # commits, or rolls back after an error
            self._db.execute("BEGIN IMMEDIATE")
            self._db.executemany("REPLACE INTO runs VALUES (?, ?, ?)", values)

    @contextlib.contextmanager
    def _errors(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.Error as error:
            if error.sqlite_errorname == "SQLITE_BUSY":
                raise ProgramError(f"{self._path.parent}: in use by another process", "wait for its end") from error
            if error.sqlite_errorname in ("SQLITE_NOTADB", "SQLITE_CORRUPT", "SQLITE_ERROR"):
                remedy = "remove it, and batch analyses all runs again"
                raise ProgramError(f"{self._path}: damaged ({error})", remedy, UNREADABLE) from error
            problem = f"could not be written ({error})"
            raise WriteFailed(self._path, problem, "check the disk space and the permissions") from error


@contextlib.contextmanager
def opened(folder: Path) -> Iterator[Store]:
    """Yield the store of a course, with other passes kept out of its folder."""
    path = folder / LOCK
    with writing(path):
        file = path.open("a+b")
    with file:
        try:
            if not lock(file):
                LOG.info(f"{folder}: there are no locks here; let only one batch at a time write there")
        except BlockingIOError as error:
            file.seek(0)
            holder = file.read(200).decode("utf-8", "replace") or "another process"
            raise ProgramError(f"{folder}: in use by {holder}", "wait for its end") from error
        with writing(path):
            file.truncate(0)
            file.write(f"process {os.getpid()} on {platform.node()} since {now_utc()}".encode("utf-8", "replace"))
            file.flush()
        with contextlib.closing(Store(folder)) as store:
            yield store
