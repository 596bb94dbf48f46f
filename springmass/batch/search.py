"""Courses behind one index: which runs are there for which an expression holds."""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from springmass import __version__
from springmass.batch.results_table import read_rows, table_of, tags_in
from springmass.batch.rows import DETAILS, FILTERED, columns_of
from springmass.errors import USAGE, ProgramError
from storage.atomic import remove_leftovers
from storage.catalog import build_catalog, catalog_stamp, count_of_catalog, search_catalog

__all__ = ["COURSE", "Found", "cache_folder", "search"]

COURSE = "course"
"""Column of the folder that a run's results lie in."""


@dataclass(frozen=True, slots=True)
class Found:
    """What a search found.

    Parameters
    ----------
    columns : tuple of str
    rows : list of mapping
        By column.
    whole : int
        Runs in the index.
    index : Path
    """

    columns: tuple[str, ...]
    rows: list[dict[str, Any]]
    whole: int
    index: Path


def search(
    folders: Sequence[str],
    *,
    where: str = "",
    columns: Sequence[str] | None = None,
    shown: Sequence[str] = (),
    sort: str | None = None,
    limit: int | None = None,
    rebuild: bool = False,
) -> Found:
    """Return the runs of courses for which an expression holds, by an index that is built where it is not there.

    Parameters
    ----------
    folders : sequence of str
        Of results.
    where : str
        An expression of SQLite over the columns; empty: all runs.
    columns : sequence of str, optional
        Left out: the courses' own and those ``shown``; where these are left out too, all.
    shown : sequence of str
    sort, limit
        As in :func:`storage.catalog.search_catalog`.
    rebuild : bool
        Whether the index is built though it seems to be of these results.

    Raises
    ------
    ProgramError, storage.errors.QueryRefused
        With exit code 2.
    """
    index, tags = _index(folders, rebuild=rebuild)
    usual = (COURSE, *shown[:1], *tags, *shown[1:]) if shown else (COURSE, *columns_of(tags))
    if len(folders) == 1 and shown:
        usual = usual[1:]
    names, rows = search_catalog(index, where=where, columns=columns or usual, sort=sort, limit=limit)
    found = [dict(zip(names, row, strict=True)) for row in rows]
    return Found(tuple(names), found, count_of_catalog(index), index)


def _index(folders: Sequence[str], *, rebuild: bool) -> tuple[Path, tuple[str, ...]]:
    """Return the index of courses, built where it is not there or of other results, and the courses' own columns."""
    tables = [_table(Path(folder)) for folder in folders]
    tags = tuple(dict.fromkeys(tag for table in tables for tag in _tags(table.parent)))
    stamp = repr([(__version__, tags), *((str(t.resolve()), *_stamp(t)) for t in tables)])
    name = hashlib.sha256("\0".join(str(table.parent.resolve()) for table in tables).encode()).hexdigest()[:16]
    place = cache_folder()
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        demand = f"a folder for the index was demanded, {error.strerror}; set XDG_CACHE_HOME to one on the local disk"
        raise ProgramError(f"{place}: {demand}", USAGE) from error
    index = place / f"{name}.sqlite"
    if rebuild or catalog_stamp(index) != stamp:
        remove_leftovers(place)
        columns = (COURSE, *columns_of(tags))
        build_catalog(index, columns, _rows(folders), long=DETAILS, indexed=(*tags, *FILTERED), stamp=stamp)
    return index, tags


def _rows(folders: Sequence[str]) -> Iterator[dict[str, Any]]:
    for folder in folders:
        for row in read_rows(Path(folder)):
            yield {**row, COURSE: folder}


def _table(folder: Path) -> Path:
    if (table := table_of(folder)) is not None:
        return table
    demand = "a folder of results that springmass batch made was demanded, got another"
    raise ProgramError(f"{folder}: {demand}; name that of its -o", USAGE)


def _tags(folder: Path) -> tuple[str, ...]:
    first = next(iter(read_rows(folder)), {})
    return tags_in(first)


def _stamp(table: Path) -> tuple[int, int, int]:
    told = os.stat(table)
    return told.st_ino, told.st_size, told.st_mtime_ns


def cache_folder() -> Path:
    """Return where indexes lie: under ``XDG_CACHE_HOME``, or where the system keeps what can be made again."""
    told = os.environ.get("XDG_CACHE_HOME") or (os.environ.get("LOCALAPPDATA") if sys.platform == "win32" else None)
    usual = "~/Library/Caches" if sys.platform == "darwin" else "~/.cache"
    return (Path(told) if told else Path(usual).expanduser()) / "springmass" / "catalogs"
