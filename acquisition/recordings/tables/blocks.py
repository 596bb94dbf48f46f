"""The grammar of blocks: which rows of a table belong together.

1. Rows whose times start again are runs of their own, and are never joined. The times are first put in order by the
   rules of :mod:`acquisition.recordings.tables.times`.
2. A column of units gives the unit of each row (:func:`with_units_of_rows`).
3. A column of words that names the sensor or the quantity of each row makes a channel of each (:func:`by_label`).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from acquisition.block import F8, I8
from acquisition.recordings.recording import FormatIssue
from acquisition.recordings.sampling.timing import median
from acquisition.recordings.tables.headings import Heading
from acquisition.recordings.tables.numbers import scaled
from acquisition.recordings.tables.table import Column, Lines, Table
from acquisition.recordings.tables.times import in_order, is_newest_first, out_of_place
from acquisition.recordings.tables.vocabulary import ANY_VALUE, LABEL
from acquisition.units import Measure, measure_of, time_unit

FEWEST_ROWS = 8
"""Usual number of rows from which on a block is a run; times of shorter blocks begin again every few rows."""
_MOST_LABELS, _SHARE_OF_CHANGES = 20, 0.1
_NEAR = 3  # rows before and after a step back that must lie on its two sides


def runs_of(table: Table) -> list[Table]:
    """Return the runs of a table, each with its times in order, if they can be put in order."""
    if table.times is None:
        return [table]
    size = table.lines.rows if table.lines is not None else max(each.values.size for each in table.columns)
    times = table.times.of_size(size)
    if is_newest_first(times.values):
        times = times.taken(np.arange(size)[::-1])
        table = _with_times(_taken(table, np.arange(size)[::-1]), times, "the rows come newest first")
    t, remark = in_order(times.values, times.decimals)
    if remark:
        return [_with_times(table, replace(times, values=t), remark)]
    if out_of_place(t):
        order = _sorted(t)
        return [_with_times(_taken(table, order), times.taken(order), "rows were out of place and were sorted")]
    begins = _begins(t)
    if not begins or median(np.diff([0, *begins, size])) < FEWEST_ROWS:
        return [table]
    parts = [_taken(table, rows) for rows in _blocks(table.lines, [0, *begins, size])]
    return [
        replace(part, run=f"{table.run}, part {number}" if table.run else f"Part {number}")
        for number, part in enumerate(parts, 1)
    ]


def _with_times(table: Table, times: Column, remark: str) -> Table:
    """Return a table with other times, which a remark explains."""
    trap = FormatIssue("times_mended", f"{remark}; the times were put in order", times.values.size)
    return replace(table, times=times, traps=(*table.traps, trap))


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
    # If every row begins with words, none is a remark between two blocks.
    ends = [int(np.max(np.flatnonzero(~lines.words[rows]), initial=-1)) + 1 for rows in blocks]
    return [rows[: end or rows.size] for rows, end in zip(blocks, ends, strict=True)]


def with_units_of_rows(
    columns: Sequence[Column], headings: Sequence[Heading]
) -> tuple[tuple[Column, ...], list[Heading]]:
    """Return columns in the largest unit that a column of units to their right gives their rows, and the headings."""
    read, of = list(columns), list(headings)
    for at, column in enumerate(columns):
        if not at or column.words is None or at >= len(of):
            continue
        units = {word: measure_of(word) or time_unit(word) for word in np.unique(column.words).tolist() if word}
        known = {word: each for word, each in units.items() if each is not None}
        if not known or len(known) < len(units) or len({each.quantity for each in known.values()}) > 1:
            continue
        if len(known) > 1 or not of[at - 1].unit:
            largest = max(known.values(), key=lambda each: 10.0**each.power * each.factor)
            read[at - 1] = _in_unit(read[at - 1], column.words, known, largest)
            of[at - 1] = replace(of[at - 1], unit=largest.symbol)
    return tuple(read), of


def _in_unit(column: Column, words: NDArray[np.str_], units: Mapping[str, Measure], unit: Measure) -> Column:
    values, forms = column.values.copy(), column.forms.copy()
    for word, measure in units.items():
        rows = np.flatnonzero(words == word)
        rows = rows[rows < values.size]
        if measure != unit:
            power = measure.power - unit.power
            values[rows] = scaled(values[rows], forms[rows], power) * (measure.factor / unit.factor)
            forms[rows] = np.where(forms[rows] >= power, forms[rows] - power, np.minimum(forms[rows], 0))
    return replace(column, values=values, decimals=forms, words=words if len(units) > 1 else None)


def by_label(table: Table) -> list[Table]:
    """Return a table, or one of each channel if a column of words tells its rows apart."""
    for column in table.beside:
        if column.words is None or table.lines is None or not table.columns:
            continue
        labels, counts = np.unique(column.words[column.words != ""], return_counts=True)
        if (
            not 2 <= labels.size <= _MOST_LABELS
            or counts.min() < FEWEST_ROWS
            or not _tells_apart(table, column.name, column.words)
        ):
            continue
        tables = []
        for label in labels.tolist():
            part = _taken(table, np.flatnonzero(column.words == label))
            names = [label if each.name.lower() in ANY_VALUE else f"{each.name} {label}" for each in part.columns]
            named = tuple(replace(each, name=name) for each, name in zip(part.columns, names, strict=True))
            tables.append(replace(part, columns=named))
        return tables
    return [table]


def _tells_apart(table: Table, heading: str, words: NDArray[np.str_]) -> bool:
    """Return whether words name sensors or quantities: by their heading, or because values go on from like to like."""
    if LABEL.intersection(re.findall(r"[^\W\d_]+", heading.lower())):
        return True
    changes = words[1:] != words[:-1]
    for each in table.columns:
        values = each.of_size(words.size).values
        within = [np.abs(np.diff(values[words == label])) for label in np.unique(words[words != ""]).tolist()]
        steps, across = np.concatenate(within), np.abs(np.diff(values))[changes]
        steps, across = steps[np.isfinite(steps)], across[np.isfinite(across)]
        if np.mean(changes) > _SHARE_OF_CHANGES and across.size and steps.size and median(steps) < 0.5 * median(across):
            return True
    return False
