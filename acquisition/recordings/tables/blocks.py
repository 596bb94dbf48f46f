"""The grammar of blocks: rows whose times start again are runs of their own, and are never joined.

The times are first put in order by the rules of :mod:`acquisition.recordings.tables.times`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from acquisition.block import F8, I8
from acquisition.recordings.recording import FormatIssue
from acquisition.recordings.sampling.timing import median
from acquisition.recordings.tables.table import Lines, Table
from acquisition.recordings.tables.times import in_order, is_newest_first, out_of_place

_FEWEST_ROWS = 8
"""Usual number of rows from which on a block is a run; times of shorter blocks begin again every few rows."""
_NEAR = 3  # rows before and after a step back that must lie on its two sides


def runs_of(table: Table) -> list[Table]:
    """Return the runs of a table, each with its times in order, if they can be put in order."""
    if table.times is None:
        return [table]
    size = table.lines.rows if table.lines is not None else max(each.values.size for each in table.columns)
    times = table.times.of_size(size)
    if is_newest_first(times.values):
        times = times.taken(np.arange(size)[::-1])
        table = _with_times(_taken(table, np.arange(size)[::-1]), times.values, "the rows come newest first")
    t, remark = in_order(times.values, times.decimals)
    if remark:
        return [_with_times(table, t, remark)]
    if out_of_place(t):
        order = _sorted(t)
        return [_with_times(_taken(table, order), t[order], "up to three rows were out of place, and were sorted")]
    begins = _begins(t)
    if not begins or median(np.diff([0, *begins, size])) < _FEWEST_ROWS:
        return [table]
    parts = [_taken(table, rows) for rows in _blocks(table.lines, [0, *begins, size])]
    return [
        replace(part, run=f"{table.run}, part {number}" if table.run else f"Part {number}")
        for number, part in enumerate(parts, 1)
    ]


def _with_times(table: Table, t: F8, remark: str) -> Table:
    """Return a table with other times, which a remark explains."""
    if table.times is None:
        raise ValueError("the table has no times")
    trap = FormatIssue("times_mended", f"{remark}; the times were put in order", t.size)
    return replace(table, times=replace(table.times.of_size(t.size), values=t), traps=(*table.traps, trap))


def _taken(table: Table, rows: I8) -> Table:
    """Return the rows of a table with these numbers."""
    lines = table.lines
    if lines is not None:
        at_end = bool(rows.size) and int(rows[-1]) == lines.rows - 1  # only then the file ends behind the last row
        lines = Lines(lines.numbers[rows], lines.words[rows], *(lines[2:] if at_end else ()))
    times = table.times and table.times.taken(rows)
    columns, beside = (tuple(each.taken(rows) for each in of) for of in (table.columns, table.beside))
    return replace(table, columns=columns, times=times, lines=lines, beside=beside)


def _sorted(t: F8) -> I8:
    """Return the order in which times rise; rows without a time follow the row before them."""
    filled = np.isfinite(t)
    at = np.maximum.accumulate(np.where(filled, np.arange(t.size), 0))
    return np.argsort(np.where(np.isfinite(t[at]), t[at], -np.inf), kind="stable")


def _begins(t: F8) -> list[int]:
    """Return the rows at which times start again: the next rows are all earlier than the rows before."""
    filled = np.flatnonzero(np.isfinite(t))
    finite = t[filled]
    return [
        int(filled[at])
        for at in (np.flatnonzero(np.diff(finite) < 0) + 1).tolist()
        if finite[at : at + _NEAR].max() < finite[max(0, at - _NEAR) : at].min() and np.ptp(finite[at : at + _NEAR]) > 0
    ]


def _blocks(lines: Lines | None, edges: Sequence[int]) -> list[I8]:
    """Return the rows of each block, without the lines of words between two blocks."""
    blocks = [np.arange(start, stop) for start, stop in pairwise(edges)]
    if lines is None:
        return blocks
    return [rows[: int(np.flatnonzero(~lines.words[rows])[-1]) + 1] for rows in blocks]
