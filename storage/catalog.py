"""Search rows by an SQLite expression, in a table in memory."""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from storage.errors import QueryRefused

_NUMBER = "number of the row"  # cannot collide, because no column name of a course contains blanks


def search_rows(
    columns: Sequence[str],
    rows: Iterable[Mapping[str, Any]],
    *,
    where: str = "",
    shown: Sequence[str] | None = None,
    sort: str | None = None,
    limit: int | None = None,
) -> tuple[list[dict[str, Any]], int]:
    """Return the columns ``shown`` of the rows for which ``where`` is true, and the number of all rows.

    A row lacks a column whose value is None. ``sort`` is a column, with the prefix - for descending order; otherwise
    the rows keep their order. Raises QueryRefused if a column does not exist or the expression is invalid.

    Examples
    --------
    >>> rows = [{"run": "a", "period": 0.8}, {"run": "b", "period": 0.9}]
    >>> search_rows(("run", "period"), rows, where="period > 0.85", shown=["run"])
    ([{'run': 'b'}], 2)
    """
    wanted = list(columns if shown is None else shown)
    by = (sort or "").removeprefix("-")
    for name in [*wanted, *([by] if by else [])]:
        if name not in columns:
            raise QueryRefused("catalog", f"expected a column, got {name!r}", "use one of the column names")
    with contextlib.closing(sqlite3.connect(":memory:")) as base:
        names = "".join(f", {_quoted(name)}" for name in columns)
        base.execute(f"CREATE TABLE runs ({_quoted(_NUMBER)} INTEGER PRIMARY KEY{names})")
        values = ", ".join("?" * (len(columns) + 1))
        numbered = ((number, *(row.get(name) for name in columns)) for number, row in enumerate(rows))
        total = base.executemany(f"INSERT INTO runs VALUES ({values})", numbered).rowcount
        # A word in double quotes that is not a column name must be an error, not a text.
        if hasattr(base, "setconfig"):
            base.setconfig(sqlite3.SQLITE_DBCONFIG_DQS_DML, False)  # type: ignore[attr-defined,unused-ignore]
        try:
            chosen = base.execute(_command(where, wanted, by, sort, limit)).fetchall()
        except (sqlite3.Error, sqlite3.Warning, ValueError, MemoryError) as error:
            got = f"expected an expression over columns, got {where!r}"
            example = "write for example \"section = 'A' and period_u < 1e-4\""
            raise QueryRefused("catalog", f"{got} ({error})", example) from error
    return [dict(zip(wanted, row, strict=True)) for row in chosen], total


def _command(where: str, wanted: Sequence[str], by: str, sort: str | None, limit: int | None) -> str:
    # Put the expression on separate lines, so that a comment at its end does not hide the closing bracket.
    condition = f" WHERE (\n{where}\n)" if where.strip() else ""
    direction = "DESC" if (sort or "").startswith("-") else "ASC"
    order = f"{_quoted(by)} {direction}, " if by else ""
    most = f" LIMIT {int(limit)}" if limit is not None else ""
    names = ", ".join(map(_quoted, wanted or [_NUMBER]))
    return f"SELECT {names} FROM runs{condition} ORDER BY {order}{_quoted(_NUMBER)}{most}"


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"'
