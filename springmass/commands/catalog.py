"""``springmass catalog``: search, filter and list the runs of courses."""

from __future__ import annotations

import json
import shlex
from collections.abc import Sequence
from pathlib import Path

from springmass.batch.search import search
from springmass.errors import OK, suggest, tell
from springmass.options import CatalogOptions

__all__ = ["run"]

SHOWN = ("run", "status", "period", "period_u", "spring_constant", "spring_constant_u", "drag_coefficient", "law")
"""Columns that are listed if none are named, with the courses' own after the first."""


def run(folders: Sequence[str | Path], options: CatalogOptions) -> int:
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
