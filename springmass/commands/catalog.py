"""``springmass catalog``: search, filter and list the runs of courses."""

from __future__ import annotations

import json
import shlex
from dataclasses import dataclass
from typing import Annotated

from cyclopts import Parameter

from springmass.batch.search import search
from springmass.commands.options import File, argument, flag, option
from springmass.errors import OK, suggest, tell
from springmass.values import Count

SHOWN = ("run", "status", "period", "period_u", "spring_constant", "spring_constant_u", "drag_coefficient", "law")
"""Columns that are listed if none are named, with the courses' own after the first."""


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class CatalogOptions:
    """The options of ``springmass catalog``."""

    where: Annotated[str, option("EXPR", "list only runs that match: \"section = 'A' and period_u < 1e-4\"")] = ""
    columns: Annotated[str | None, option("A,B", "columns to list")] = None
    sort: Annotated[str | None, option("NAME", "sort by this column; --sort=-NAME: largest first")] = None
    limit: Annotated[Count | None, option("N", "list at most N runs")] = None
    json: Annotated[bool, flag("print one JSON object per run instead of CSV")] = False


def catalog(
    *folders: Annotated[File, argument("DIR", "folders that batch created", required=True)],
    options: CatalogOptions = CatalogOptions(),
) -> int:
    """Print the runs for which an expression holds, as CSV or as JSON lines."""
    from springmass.batch.results_table import text_of

    courses = [str(folder) for folder in folders]
    wanted = None if options.columns is None else [name.strip() for name in options.columns.split(",")]
    found = search(courses, where=options.where, columns=wanted, shown=SHOWN, sort=options.sort, limit=options.limit)
    if options.json:
        for row in found.rows:
            print(json.dumps(row, allow_nan=False))
    else:
        print(text_of(found.rows, found.columns), end="")
    if found.rows and "run" in found.columns:
        suggest(f"springmass report {shlex.join([*courses[:1], str(found.rows[0]['run'])])}")
    tell(f"{len(found.rows)} of {found.total} runs")
    return OK
