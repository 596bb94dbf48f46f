"""One channel as a file has it: which rows of a sheet are its own, what could not be read, and its samples."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from acquisition.block import F8, U8, Flag
from acquisition.errors import FormatError
from acquisition.recordings.recording import Trap
from acquisition.recordings.sampling.samples import Rows, flags_of, place, row_traps, sample_traps, within
from acquisition.recordings.sampling.timing import (
    Timing,
    clock_traps,
    time_by_column,
    time_by_formula,
    time_by_rate,
    tolerance_of,
)
from acquisition.recordings.tables.contents import Arrays, Channel, Sheet
from acquisition.recordings.tables.table import EMPTY, EXPONENT, UNREAD, Table, read_table
from acquisition.recordings.units import TIMES, time_factor, time_power

__all__ = ["Sampled", "pull", "sample"]

_LONGEST_S = 1e10
_T = TypeVar("_T", bound=np.generic)


@dataclass(frozen=True, slots=True, eq=False)
class Sampled:
    """One channel's samples.

    Parameters
    ----------
    t : (n,) float64, s
    value : (n,) float64
    flags : (n,) uint8
    timing : Timing
    resolution : float
        Last printed digit of a value.
    traps : tuple of Trap
        What was seen in times and rows.
    line : callable
        Gives the one-based line of a sample; None in a binary file.
    malformed_rows : int
    behind : tuple of (rows,) float64
        The columns behind the value, without the rows that could not be read.
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


def pull(path: str, channel: Channel, power: int) -> Rows:
    """Read a channel's times and values.

    Parameters
    ----------
    path : str
        For messages.
    channel : Channel
    power : int
        Values are multiplied with ten to this power.

    Raises
    ------
    FormatError
        If there are no numbers, or times in a unit that is not known.
    """
    if isinstance(channel.source, Arrays):
        return _from_arrays(path, channel, channel.source, power)
    return _from_sheet(path, channel, channel.source, power)


def _from_arrays(path: str, channel: Channel, arrays: Arrays, power: int) -> Rows:
    value = arrays.values / 10.0**-power if power else arrays.values.copy()
    # A copy: channels may share the times, and they will be written to.
    t = None if arrays.t is None else arrays.t * time_factor(channel.time_unit) / 10.0 ** -_time_power(path, channel)
    bad = np.zeros(value.size, bool) if t is None else ~np.isfinite(t)
    if bad.any():
        value[bad] = np.nan
    largest = 0.0 if t is None else float(np.fmax.reduce(np.abs(t), initial=0.0))
    return Rows(t, value, bad, np.zeros_like(bad), _no_line, max(float(np.spacing(largest)), 1e-12), 0.0)


def _no_line(row: int) -> int:  # noqa: ARG001
    """Return 0: binary files have no lines."""
    return 0


def _from_sheet(path: str, channel: Channel, sheet: Sheet, power: int) -> Rows:
    time, shift = channel.time, _time_power(path, channel)
    # The first column of a sheet tells rows from remarks, whoever's it is, unless it is left empty.
    row = next(sheet.text.lines(sheet.start), None)
    leads = row is not None and row.text.split(sheet.delimiter or None)[:1] not in ([], [""])
    asked = range(sheet.width) if sheet.width else [*([0] if leads else []), time, channel.column]
    columns = [column for column in dict.fromkeys(asked) if column is not None]
    table = read_table(
        sheet.text,
        columns,
        sheet.delimiter,
        width=sheet.width,
        start=sheet.start,
        stop=sheet.stop,
        first_line=sheet.first_line,
        shifts=[shift if column == time else power if column >= channel.column else 0 for column in columns],
    )
    own = columns.index(channel.column)
    at = None if time is None else columns.index(time)
    if sheet.width:
        keep, remark = np.ones(len(table), bool), np.zeros(len(table), bool)
    else:
        remark = table.text & (table.form[own] == EMPTY)
        if at is not None:
            remark &= (table.form[at] == EMPTY) | (table.form[at] == UNREAD)
        keep = _present(table, own, at, channel.ragged) | remark
    if not (keep & ~remark).any():
        raise _no_rows(path, channel, sheet, 0, sheet.first_line)
    kept = None if keep.all() else np.flatnonzero(keep)
    remark = _kept(remark, kept)
    unread = table.bad if sheet.width else table.form[own] == UNREAD
    if at is not None and table.cut and table.form[at][-1] == UNREAD:
        unread[-1] = True  # its time stopped midway
    bad = _kept(unread, kept) | remark
    printed = tolerance = None
    time_resolution = 0.0
    if at is not None:
        printed = np.require(_kept(table.values[at], kept), requirements="W")
        time_resolution = _resolution(printed, table.decimals[at], table.exponents[at], shift)
        if channel.formula is not None:
            tolerance = tolerance_of(printed, _kept(table.form[at], kept), shift, EXPONENT)
        if (factor := time_factor(channel.time_unit)) != 1.0:
            printed, time_resolution = printed * factor, time_resolution * factor
        if not within(printed, _LONGEST_S):
            none = ~(np.abs(printed) < _LONGEST_S)
            printed, bad = np.where(none, np.nan, printed), bad | none
    value = np.require(_kept(table.values[own], kept), requirements="W")
    if bad.any():
        value = np.where(bad, np.nan, value)

    def line(row: int) -> int:
        return table.line(row if kept is None else int(kept[row]))

    if bad.all():
        raise _no_rows(path, channel, sheet, bad.size, line(0))
    cut = table.cut and bool(bad[-1]) and bool(keep[-1])
    decimals = 0 if at is None else table.decimals[at]
    resolution = _resolution(value, table.decimals[own], table.exponents[own], power)
    return Rows(
        printed,
        value,
        bad,
        remark,
        line,
        time_resolution,
        resolution,
        tolerance,
        cut,
        table.last_cell,
        decimals,
        tuple(_kept(column, kept) for column in table.values[own + 1 :]),
    )


def _no_rows(path: str, channel: Channel, sheet: Sheet, lines: int, line: int) -> FormatError:
    numbers = f"{sheet.width} numbers" if sheet.width else f'numbers for "{channel.name}"'
    demand = f"expected rows of {numbers}, got none" + (f" in {lines} lines" if lines else "")
    remedy = "check that rows and headings belong together" if lines else "check that the export ended"
    return FormatError(path, demand, remedy, line=line)


def _time_power(path: str, channel: Channel) -> int:
    timed = channel.source.t is not None if isinstance(channel.source, Arrays) else channel.time is not None
    if not timed or not channel.time_unit:
        return 0
    power = time_power(channel.time_unit)
    if power is None:
        demand = f'expected times in one of {", ".join(TIMES)}, got "{channel.time_unit}"'
        raise FormatError(path, demand, "export the times in seconds")
    return power


def _kept(column: NDArray[_T], rows: NDArray[np.int64] | None) -> NDArray[_T]:
    return column if rows is None else column[rows]


def _present(table: Table, own: int, at: int | None, ragged: bool) -> NDArray[np.bool_]:
    """Tell rows that hold something of the channel: others belong to a longer one beside it."""
    empty = table.form[own] == EMPTY
    keep = np.ones(empty.size, bool) if at is None else ~(empty & (table.form[at] == EMPTY))
    if ragged or at is None:
        # Only empty cells at the end tell nothing: one in the middle is a sample that was lost.
        some = np.flatnonzero(~empty)
        keep[int(some[-1]) + 1 if some.size else 0 :] = False
    return keep


def _resolution(values: F8, decimals: int, exponents: bool, shift: int) -> float:
    """Return the last printed digit; of numbers with exponents that of the largest."""
    if exponents:
        largest = float(np.fmax.reduce(np.abs(values), initial=0.0))
        shift = int(np.floor(np.log10(largest))) if largest > 0 else shift
    return float(f"1e{shift - decimals}")


def sample(path: str, channel: Channel, rows: Rows, rate_hz: float | None, zeros: int = 0) -> Sampled:
    """Put a channel's values at their times; the rows are used up.

    Parameters
    ----------
    path : str
        For messages.
    channel : Channel
    rows : Rows
    rate_hz : float or None
        The rate, where it is given.
    zeros : int
        Zero bytes at the end of the file, left out.

    Raises
    ------
    NeedsAnswer
        If nothing tells the rate and it is not given.
    FormatError
        If the rate given contradicts the file, or all values are NaN.
    """
    timing, traps = _timing(path, channel, rows, rate_hz)
    value, bad, t = rows.value, rows.bad, place(rows, timing)
    told = np.isfinite(t)
    where = None if told.all() else np.flatnonzero(told)
    t, value = _kept(t, where), _kept(value, where)
    if np.isnan(value).all():
        demand = f'expected numbers as "{channel.name}", got NaN in all {value.size} rows'
        raise FormatError(path, demand, "record the run again", line=rows.line(0) or None)

    def line(row: int) -> int | None:
        return rows.line(row if where is None else int(where[row])) or None

    flags = flags_of(t, value, _kept(bad, where), timing.rate_hz)
    if channel.difference and not bad[0] and np.isnan(value[0]):
        flags[0] &= ~np.uint8(Flag.MISSING)
    found = (*row_traps(rows, told, zeros), *sample_traps(flags, t, timing.rate_hz, line))
    malformed = int(np.count_nonzero(bad))
    behind = tuple(column[~bad] if malformed else column for column in rows.behind)
    return Sampled(t, value, flags, timing, rows.resolution, (*traps, *found), line, malformed, behind)


def _timing(path: str, channel: Channel, rows: Rows, rate_hz: float | None) -> tuple[Timing, tuple[Trap, ...]]:
    traps: list[Trap] = []
    formula, printed, bad = channel.formula, rows.printed, rows.bad
    timing = None
    if formula is not None:
        count = int(np.count_nonzero(~rows.remark))
        if formula.samples is not None and formula.samples != count:
            message = f"the header declares {formula.samples} samples, {count} rows are there; all are kept"
            traps.append(Trap("stale_header", message, abs(formula.samples - count)))
        whole = np.where(bad, np.nan, printed) if printed is not None and bad.any() else printed
        timing = time_by_formula(path, formula.start_s, formula.step_s, whole, rows.tolerance, rows.numbers, rate_hz)
        if timing is None:
            said = f"the header says {formula.start_s:g} s + i * {formula.step_s:g} s"
            if printed is None:
                traps.append(Trap("stale_header", f"{said}, which makes no times"))
            else:
                message = f"{said}, the column of times says otherwise and is believed"
                traps.append(Trap("stale_header", message, printed.size))
    if timing is None and printed is not None:
        timing = time_by_column(path, printed[~bad] if bad.any() else printed, rows.time_resolution, rate_hz)
        if not channel.time_unit and formula is None:
            traps.append(Trap("unit_assumed", "the times have no unit: read as seconds"))
    if timing is None:
        timing = time_by_rate(path, rate_hz, "no column of times and no sampling interval")
    return timing, (*traps, *clock_traps(timing))
