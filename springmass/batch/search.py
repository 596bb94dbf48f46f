"""Search courses for the runs that satisfy an expression."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from acquisition.errors import visible
from springmass.batch.rows import COURSE, columns_of
from springmass.batch.store import open_course, table_rows
from storage.catalog import search_rows

__all__ = ["SearchResult", "search"]


@dataclass(frozen=True, slots=True)
class SearchResult:
    """The runs that satisfy an expression.

    Parameters
    ----------
    columns : tuple of str
    rows : list of mapping
        Values of each row by column.
    total : int
        Number of runs in the courses.
    """

    columns: tuple[str, ...]
    rows: list[dict[str, Any]]
    total: int


def search(
    folders: Sequence[str],
    *,
    where: str = "",
    columns: Sequence[str] | None = None,
    shown: Sequence[str] = (),
    sort: str | None = None,
    limit: int | None = None,
) -> SearchResult:
    """Return the runs of courses that satisfy an expression.

    Parameters
    ----------
    folders : sequence of str
        Folders of results.
    where : str
        SQLite expression in the columns and in ``course``, which is the folder; empty: all runs.
    columns : sequence of str, optional
        Columns to return; if omitted, the courses' own columns and ``shown``. If both are omitted, all columns.
    shown : sequence of str
        Columns to return in addition to the courses' own.
    sort, limit
        As in :func:`storage.catalog.search_rows`.

    Raises
    ------
    ProgramError
        With exit code 2 if a folder contains no course, 3 if a course is not complete or is damaged.
    storage.errors.QueryRefused
        If the expression is not valid.
    """
    stores = [open_course(folder) for folder in folders]
    tags = tuple(dict.fromkeys(tag for store in stores for tag in store.tags))
    usual = (COURSE, *shown[:1], *tags, *shown[1:]) if shown else (COURSE, *columns_of(tags))
    if len(folders) == 1 and shown:
        usual = usual[1:]
    wanted = tuple(columns or usual)
    rows = (
        {**row, COURSE: visible(folder)}
        for folder, store in zip(folders, stores, strict=True)
        for row in table_rows(store)
    )
    chosen, total = search_rows((COURSE, *columns_of(tags)), rows, where=where, shown=wanted, sort=sort, limit=limit)
    return SearchResult(wanted, chosen, total)
