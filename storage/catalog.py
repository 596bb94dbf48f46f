"""A catalog of runs: an index in SQLite on the local disk, made of their results, and thrown away without a loss.

Numbers and short texts stand in one table, long texts in another: a filter reads the first alone.
"""

from __future__ import annotations

import contextlib
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from acquisition.regular_file import open_regular
from storage.atomic import whole_file
from storage.errors import QueryRefused, RunDamaged

__all__ = ["build_catalog", "catalog_stamp", "count_of_catalog", "search_catalog"]

_NUMBER = "number"  # of a row in both tables
_ALLOWED = {
    sqlite3.SQLITE_SELECT,
    sqlite3.SQLITE_READ,
    sqlite3.SQLITE_FUNCTION,
}
STEPS = 100_000  # of SQLite's machine between two looks at what a question has cost
MOST_STEPS = 20_000  # such looks, a minute or so, after which a question is given up
MOST_INDEXED = 40  # columns
MAPPED = 1 << 30  # bytes of a catalog


def build_catalog(
    path: str | os.PathLike[str],
    columns: Sequence[str],
    rows: Iterable[Mapping[str, Any]],
    *,
    long: Sequence[str] = (),
    indexed: Sequence[str] = (),
    stamp: str = "",
) -> Path:
    """Write a catalog whole, in place of one that stands there.

    Parameters
    ----------
    path : path
        Its folder must exist.
    columns : sequence of str
    rows : iterable of mapping
        Text, int, float or None by column; a column that a row lacks is None.
    long : sequence of str
        The columns that hold long texts.
    indexed : sequence of str
        The columns that are filtered by most.
    stamp : str
        What it was made of, see :func:`catalog_stamp`.

    Raises
    ------
    storage.errors.WriteFailed
        If it cannot be written.
    """
    short = [name for name in columns if name not in long]
    long = [name for name in columns if name in long]
    with whole_file(path) as temporary, contextlib.closing(sqlite3.connect(temporary)) as base:
        # It is put in place by rename: a journal would only guard a file that nobody sees yet.
        base.executescript("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF;")
        with base:
            base.execute("CREATE TABLE stamp (text TEXT)")
            base.execute("INSERT INTO stamp VALUES (?)", (stamp,))
            for table, names in (("runs", short), ("details", long)):
                told = "".join(f", {_quoted(name)}" for name in names)
                base.execute(f"CREATE TABLE {table} ({_NUMBER} INTEGER PRIMARY KEY{told})")
            into = [
                (f"INSERT INTO {table} VALUES ({', '.join('?' * (len(names) + 1))})", names)
                for table, names in (("runs", short), ("details", long))
            ]
            for number, row in enumerate(rows):
                for command, names in into:
                    base.execute(command, (number, *(row.get(name) for name in names)))
            for name in [name for name in indexed if name in short][:MOST_INDEXED]:
                base.execute(f"CREATE INDEX {_quoted('by ' + name)} ON runs ({_quoted(name)})")
            base.execute("ANALYZE")
    return Path(path)


def catalog_stamp(path: str | os.PathLike[str]) -> str | None:
    """Return what a catalog was made of; None where none stands there that can be read."""
    try:
        with _opened(path) as base:
            return str(base.execute("SELECT text FROM stamp").fetchone()[0])
    except (sqlite3.Error, TypeError):
        return None


def count_of_catalog(path: str | os.PathLike[str]) -> int:
    """Return how many runs a catalog holds."""
    with _opened(path) as base:
        return int(base.execute("SELECT COUNT(*) FROM runs").fetchone()[0])


def search_catalog(
    path: str | os.PathLike[str],
    *,
    where: str = "",
    columns: Sequence[str] | None = None,
    sort: str | None = None,
    limit: int | None = None,
) -> tuple[list[str], list[tuple[Any, ...]]]:
    """Return the names of the columns, and the rows for which an expression holds.

    Parameters
    ----------
    path : path
    where : str
        An expression of SQLite over the columns; empty: all rows.
    columns : sequence of str, optional
        Left out: those without long texts.
    sort : str, optional
        A column, after a minus from the greatest down; left out: as the results have them.
    limit : int, optional
        Rows at most.

    Raises
    ------
    QueryRefused
        If a column is not there, the expression is none, or it would do anything but read.
    RunDamaged
        If the file is no catalog.
    """
    try:
        with _opened(path) as base:
            short, long = (
                [row[1] for row in base.execute(f"PRAGMA table_info({table})")][1:] for table in ("runs", "details")
            )
            if not short:
                raise RunDamaged(path, "a catalog was demanded, got another file", "build it again")
            wanted = list(short if columns is None else columns)
            by = (sort or "").removeprefix("-")
            for name in [*wanted, *([by] if by else [])]:
                if name not in (*short, *long):
                    raise QueryRefused(path, f"a column was demanded, there is no {name!r}", "see the columns' names")
            command = _command(where, wanted, long, by, sort, limit)
            base.set_authorizer(_authorise)
            steps = 0

            def tired() -> int:
                nonlocal steps
                steps += 1
                return int(steps > MOST_STEPS)

            base.set_progress_handler(tired, STEPS)
            return wanted, base.execute(command).fetchall()
    except sqlite3.DatabaseError as error:
        if "not a database" in str(error) or "malformed" in str(error):
            raise RunDamaged(path, f"a catalog was demanded ({error})", "build it again") from error
        demand = f"an expression over columns was demanded, got {where!r} ({error})"
        raise QueryRefused(path, demand, "for example --where \"section = 'A' and period_u < 1e-4\"") from error


def _command(
    where: str, wanted: Sequence[str], long: Sequence[str], by: str, sort: str | None, limit: int | None
) -> str:
    tables = f"runs JOIN details USING ({_NUMBER})" if {*wanted, by} & {*long} or _names(where, long) else "runs"
    told = ", ".join(map(_quoted, wanted)) or _NUMBER
    # On a line of its own: a comment at the expression's end ends there, too.
    command = f"SELECT {told} FROM {tables}" + (f" WHERE (\n{where}\n)" if where.strip() else "")
    command += f" ORDER BY {_quoted(by)} {'DESC' if (sort or '').startswith('-') else 'ASC'}, {_NUMBER}" if by else (
        f" ORDER BY {_NUMBER}"
    )  # fmt: skip
    return command + (f" LIMIT {int(limit)}" if limit is not None else "")


def _names(where: str, names: Sequence[str]) -> bool:
    return any(name in where for name in names)


def _authorise(action: int, first: str | None, second: str | None, _: str | None, __: str | None) -> int:
    if action == sqlite3.SQLITE_FUNCTION and second in ("load_extension", "readfile", "writefile"):
        return sqlite3.SQLITE_DENY
    if action == sqlite3.SQLITE_READ and first not in ("runs", "details"):
        return sqlite3.SQLITE_DENY
    return sqlite3.SQLITE_OK if action in _ALLOWED else sqlite3.SQLITE_DENY


@contextlib.contextmanager
def _opened(path: str | os.PathLike[str]) -> Iterator[sqlite3.Connection]:
    """Open for reading alone, an absent file is not made."""
    try:
        open_regular(path).close()  # SQLite would wait for a pipe for ever
    except OSError as error:
        raise sqlite3.OperationalError(error.strerror) from error
    name = quote(os.path.abspath(path), errors="surrogateescape")
    with contextlib.closing(sqlite3.connect(f"file:{name}?mode=ro&immutable=1", uri=True)) as base:
        base.execute(f"PRAGMA mmap_size = {MAPPED}")  # pages are read where they lie, not copied
        # A word in double quotes that is no column is an error, and not a text.
        if hasattr(base, "setconfig"):
            base.setconfig(sqlite3.SQLITE_DBCONFIG_DQS_DML, False)  # type: ignore[attr-defined,unused-ignore]
        yield base


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"'
