"""``springmass catalog``: search, filter and list the runs of courses."""

from __future__ import annotations

import argparse
import json
import shlex

from springmass.batch.search import search
from springmass.errors import OK, suggest, tell

__all__ = ["run"]

SHOWN = ("run", "status", "period", "period_u", "spring_constant", "spring_constant_u", "drag_coefficient", "law")
"""Columns that are listed where none are named, after the courses' own."""


def run(options: argparse.Namespace) -> int:
    """Print the runs for which an expression holds, as CSV or as JSON lines."""
    from springmass.batch.results_table import text_of

    wanted = None if options.columns is None else [name.strip() for name in options.columns.split(",")]
    found = search(
        options.input, where=options.where, columns=wanted, shown=SHOWN, sort=options.sort, limit=options.limit,
        rebuild=options.rebuild,
    )  # fmt: skip
    if options.json:
        for row in found.rows:
            print(json.dumps(row, allow_nan=False))
    else:
        print(text_of(found.rows, found.columns), end="")
    if found.rows and "run" in found.columns:
        suggest(f"springmass report {shlex.join([*options.input[:1], str(found.rows[0]['run'])])}")
    tell(f"{len(found.rows)} of {found.whole} runs; the index: {found.index}")
    return OK
