"""Search rows in memory by an SQLite expression that can read only these rows and whose run time is limited."""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from storage.errors import QueryRefused

__all__ = ["search_rows"]

_NUMBER = "number of the row"  # cannot collide, because no column name of a course contains blanks
_ALLOWED = {sqlite3.SQLITE_SELECT, sqlite3.SQLITE_READ, sqlite3.SQLITE_FUNCTION}
_DENIED = ("load_extension", "readfile", "writefile", "printf", "format")
"""Functions that read or write files, or that may run for a long time within one instruction."""
STEPS = 100_000  # number of SQLite's virtual machine instructions between two calls of the progress handler
# Maximum number of calls of the progress handler: 15 to 30 s, at 1.4 to 2.9 ms a call for sums over joined tables.
MOST_CALLS = 10_000
LONGEST = 1_000_000  # maximum size of a value or row, bytes; otherwise one instruction could make a text of any length
LONGEST_PATTERN = 100  # maximum size of a LIKE or GLOB pattern, bytes; each asterisk multiplies an instruction's time


def search_rows(
    columns: Sequence[str],
    rows: Iterable[Mapping[str, Any]],
    *,
    where: str = "",
    shown: Sequence[str] | None = None,
    sort: str | None = None,
    limit: int | None = None,
) -> tuple[list[dict[str, Any]], int]:
    """Return the rows for which an expression is true, and the number of all rows.

    Parameters
    ----------
    columns : sequence of str
    rows : iterable of mapping
        Text, int, float or None by column; a missing column is None.
    where : str
        An SQLite expression over the columns; empty for all rows.
    shown : sequence of str, optional
        The columns to return; all by default.
    sort : str, optional
        A column; prefix it with - for descending order. By default the rows keep their order.
    limit : int, optional
        Maximum number of rows to return.

    Raises
    ------
    QueryRefused
        If a column does not exist, or the expression is invalid, takes too long or would do anything but read.

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
    calls = 0

    def exhausted() -> int:
        nonlocal calls
        calls += 1
        return int(calls > MOST_CALLS)

    with contextlib.closing(sqlite3.connect(":memory:")) as base:
        total = _fill(base, columns, rows)
        base.set_authorizer(_authorise)
        base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LONGEST)
        base.setlimit(sqlite3.SQLITE_LIMIT_LIKE_PATTERN_LENGTH, LONGEST_PATTERN)
        base.set_progress_handler(exhausted, STEPS)
        # A word in double quotes that is not a column name must be an error, not a text.
        if hasattr(base, "setconfig"):
            base.setconfig(sqlite3.SQLITE_DBCONFIG_DQS_DML, False)  # type: ignore[attr-defined,unused-ignore]
        try:
            chosen = base.execute(_command(where, wanted, by, sort, limit)).fetchall()
        except (sqlite3.Error, sqlite3.Warning, ValueError, MemoryError) as error:
            got = f"expected an expression over columns, got {where!r}"
            if calls > MOST_CALLS:
                raise QueryRefused("catalog", "the expression takes too long", "use a simpler one") from error
            example = "write for example \"section = 'A' and period_u < 1e-4\""
            raise QueryRefused("catalog", f"{got} ({error})", example) from error
    return [dict(zip(wanted, row, strict=True)) for row in chosen], total


def _fill(base: sqlite3.Connection, columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> int:
    """Create the table of the rows; return the number of rows."""
    names = "".join(f", {_quoted(name)}" for name in columns)
    base.execute(f"CREATE TABLE runs ({_quoted(_NUMBER)} INTEGER PRIMARY KEY{names})")
    values = ", ".join("?" * (len(columns) + 1))
    each = ((number, *(row.get(name) for name in columns)) for number, row in enumerate(rows))
    return base.executemany(f"INSERT INTO runs VALUES ({values})", each).rowcount


def _command(where: str, wanted: Sequence[str], by: str, sort: str | None, limit: int | None) -> str:
    # Put the expression on separate lines, so that a comment at its end does not hide the closing bracket.
    condition = f" WHERE (\n{where}\n)" if where.strip() else ""
    direction = "DESC" if (sort or "").startswith("-") else "ASC"
    order = f"{_quoted(by)} {direction}, " if by else ""
    most = f" LIMIT {int(limit)}" if limit is not None else ""
    names = ", ".join(map(_quoted, wanted or [_NUMBER]))
    return f"SELECT {names} FROM runs{condition} ORDER BY {order}{_quoted(_NUMBER)}{most}"


def _authorise(action: int, first: str | None, second: str | None, _: str | None, __: str | None) -> int:
    if action == sqlite3.SQLITE_FUNCTION and second in _DENIED:
        return sqlite3.SQLITE_DENY
    if action == sqlite3.SQLITE_READ and first != "runs":
        return sqlite3.SQLITE_DENY
    return sqlite3.SQLITE_OK if action in _ALLOWED else sqlite3.SQLITE_DENY


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"'
