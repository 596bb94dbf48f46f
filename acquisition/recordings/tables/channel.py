"""Read one channel of a file: its rows, including those that could not be read, and its samples."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from acquisition.block import B1, F8, U8, Flag
from acquisition.errors import FormatError
from acquisition.recordings.recording import Trap
from acquisition.recordings.sampling.samples import Rows, flags_of, place, row_traps, sample_traps
from acquisition.recordings.sampling.timing import Timing
from acquisition.recordings.tables.contents import Arrays, Channel, Sheet
from acquisition.recordings.tables.table import EMPTY, UNREAD, Table, read_table
from acquisition.recordings.tables.times import last_digit, power_of_times, printed_times, timing_of
from acquisition.recordings.units import time_factor

__all__ = ["ChannelSamples", "read_rows", "to_samples"]

_T = TypeVar("_T", bound=np.generic)


@dataclass(frozen=True, slots=True, eq=False)
class ChannelSamples:
    """The samples of one channel.

    Parameters
    ----------
    t : (n,) float64, s
    value : (n,) float64
    flags : (n,) uint8
    timing : Timing
    resolution : float
        Size of the last printed digit of a value.
    traps : tuple of Trap
        Remarks on times and rows.
    line : callable
        Returns the one-based line number of a sample; None for a binary file.
    malformed_rows : int
    behind : tuple of (rows,) float64
        The columns after the value, without the rows that could not be read.
    """

    t: F8
    value: F8
    flags: U8
    timing: Timing
    resolution: float
    traps: tuple[Trap, ...]
    line: Callable[[int], int | None]
    malformed_rows: int
    behind: tuple[F8, ...]


def read_rows(path: str, channel: Channel, power: int) -> Rows:
    """Read a channel's times and values.

    Parameters
    ----------
    path : str
        For messages.
    channel : Channel
    power : int
        Values are multiplied by ten to this power.

    Raises
    ------
    FormatError
        If there are no numbers, or the times have an unknown unit.
    """
    if isinstance(channel.source, Arrays):
        return _from_arrays(path, channel, channel.source, power)
    return _from_sheet(path, channel, channel.source, power)


def _from_arrays(path: str, channel: Channel, arrays: Arrays, power: int) -> Rows:
    value = arrays.values / 10.0**-power if power else arrays.values.copy()
    # The times are copied, because channels may share them and they are changed later.
    t = None if arrays.t is None else arrays.t * time_factor(channel.time_unit) / 10.0 ** -power_of_times(path, channel)
    unread = np.zeros(value.size, bool) if t is None else ~np.isfinite(t)
    if unread.any():
        value[unread] = np.nan
    largest = 0.0 if t is None else float(np.fmax.reduce(np.abs(t), initial=0.0))
    return Rows(t, value, unread, np.zeros_like(unread), _no_line, max(float(np.spacing(largest)), 1e-12), 0.0)


def _no_line(row: int) -> int:  # noqa: ARG001
    """Return 0: binary files have no lines."""
    return 0


def _from_sheet(path: str, channel: Channel, sheet: Sheet, power: int) -> Rows:
    time_power = power_of_times(path, channel)
    columns = _columns(channel, sheet)
    table = read_table(
        sheet.text,
        columns,
        sheet.delimiter,
        width=sheet.width,
        start=sheet.start,
        stop=sheet.stop,
        first_line=sheet.first_line,
        shifts=[
            time_power if column == channel.time else power if column >= channel.column else 0 for column in columns
        ],
    )
    own = columns.index(channel.column)
    at = None if channel.time is None else columns.index(channel.time)
    keep, remark, unread = _own_rows(table, own, at, every=bool(sheet.width), ragged=channel.ragged)
    if not (keep & ~remark).any():
        raise _no_rows(path, channel, sheet, 0, sheet.first_line)
    chosen = None if keep.all() else np.flatnonzero(keep)
    remark = _selected(remark, chosen)
    unknown = _selected(unread, chosen) | remark
    times = None
    if at is not None:
        printed = np.require(_selected(table.values[at], chosen), requirements="W")
        form = _selected(table.form[at], chosen)
        times = printed_times(channel, printed, form, table.decimals[at], table.exponents[at], time_power)
        unknown |= times.unknown
    value = np.require(_selected(table.values[own], chosen), requirements="W")
    if unknown.any():
        value = np.where(unknown, np.nan, value)

    def line(row: int) -> int:
        return table.line(row if chosen is None else int(chosen[row]))

    if unknown.all():
        raise _no_rows(path, channel, sheet, unknown.size, line(0))
    return Rows(
        printed=None if times is None else times.t,
        value=value,
        unread=unknown,
        remark=remark,
        line=line,
        time_resolution=0.0 if times is None else times.resolution_s,
        resolution=last_digit(value, table.decimals[own], table.exponents[own], power),
        tolerance=None if times is None else times.tolerance,
        cut=table.cut and bool(unknown[-1]) and bool(keep[-1]),
        last_cell=table.last_cell,
        decimals=0 if at is None else table.decimals[at],
        behind=tuple(_selected(column, chosen) for column in table.values[own + 1 :]),
    )


def _columns(channel: Channel, sheet: Sheet) -> list[int]:
    """Return the columns to read for a channel: all if rows have a fixed width, else only the columns it needs."""
    if sheet.width:
        return list(range(sheet.width))
    # Unless it is empty, the first column distinguishes rows from remarks, even if it belongs to another channel.
    row = next(sheet.text.lines(sheet.start), None)
    leads = row is not None and row.text.split(sheet.delimiter or None)[:1] not in ([], [""])
    needed = ([0] if leads else []) + ([] if channel.time is None else [channel.time]) + [channel.column]
    return list(dict.fromkeys(needed))


def _own_rows(table: Table, own: int, at: int | None, *, every: bool, ragged: bool) -> tuple[B1, B1, B1]:
    """Return three masks of a table's rows: rows of the channel, remarks among them, and rows that could not be read.

    Parameters
    ----------
    table : Table
    own, at : int, int or None
        The columns of the values and of the times.
    every : bool
        Whether every cell of a row must be a number, so that no row is a remark.
    ragged : bool
        See :class:`acquisition.recordings.tables.contents.Channel`.
    """
    if every:
        keep, remark, unread = np.ones(len(table), bool), np.zeros(len(table), bool), table.unread
    else:
        remark = table.text & (table.form[own] == EMPTY)
        if at is not None:
            remark &= (table.form[at] == EMPTY) | (table.form[at] == UNREAD)
        keep, unread = _present(table, own, at, ragged) | remark, table.form[own] == UNREAD
    if at is not None and table.cut and table.form[at][-1] == UNREAD:
        unread[-1] = True  # its time is incomplete
    return keep, remark, unread


def _no_rows(path: str, channel: Channel, sheet: Sheet, lines: int, line: int) -> FormatError:
    numbers = f"{sheet.width} numbers" if sheet.width else f'numbers for "{channel.name}"'
    problem = f"expected rows of {numbers}, got none" + (f" in {lines} lines" if lines else "")
    remedy = "check that rows and headings belong together" if lines else "check that the export ended"
    return FormatError(path, problem, remedy, line=line)


def _selected(column: NDArray[_T], rows: NDArray[np.int64] | None) -> NDArray[_T]:
    return column if rows is None else column[rows]


def _present(table: Table, own: int, at: int | None, ragged: bool) -> B1:
    """Return the mask of the rows of the channel; other rows belong to a longer channel of the same table."""
    empty = table.form[own] == EMPTY
    keep = np.ones(empty.size, bool) if at is None else ~(empty & (table.form[at] == EMPTY))
    if ragged or at is None:
        # Empty cells at the end follow the channel's last sample; an empty cell before it is a lost sample.
        some = np.flatnonzero(~empty)
        keep[int(some[-1]) + 1 if some.size else 0 :] = False
    return keep


def to_samples(path: str, channel: Channel, rows: Rows, rate_hz: float | None, zeros: int = 0) -> ChannelSamples:
    """Return the samples of a channel from its rows; the arrays of the rows are changed.

    Parameters
    ----------
    path : str
        For messages.
    channel : Channel
    rows : Rows
    rate_hz : float or None
        The rate that the user gives, if any.
    zeros : int
        Number of zero bytes at the end of the file, which were left out.

    Raises
    ------
    NeedsAnswer
        If the rate is neither stated nor given.
    FormatError
        If the given rate contradicts the file, or all values are NaN.
    """
    timing, traps = timing_of(path, channel, rows, rate_hz)
    value, unread, t = rows.value, rows.unread, place(rows, timing)
    timed = np.isfinite(t)
    where = None if timed.all() else np.flatnonzero(timed)
    t, value = _selected(t, where), _selected(value, where)
    if np.isnan(value).all():
        problem = f'expected numbers as "{channel.name}", got NaN in all {value.size} rows'
        raise FormatError(path, problem, "record the run again", line=rows.line(0) or None)

    def line(row: int) -> int | None:
        return rows.line(row if where is None else int(where[row])) or None

    flags = flags_of(t, value, _selected(unread, where), timing.rate_hz)
    if channel.difference and not unread[0] and np.isnan(value[0]):
        flags[0] &= ~np.uint8(Flag.MISSING)
    row_traps_found = (*row_traps(rows, timed, zeros), *sample_traps(flags, t, timing.rate_hz, line))
    malformed = int(np.count_nonzero(unread))
    behind = tuple(column[~unread] if malformed else column for column in rows.behind)
    return ChannelSamples(t, value, flags, timing, rows.resolution, (*traps, *row_traps_found), line, malformed, behind)
