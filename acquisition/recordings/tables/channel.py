"""One channel as a file has it: which rows of a sheet are its own, and which of them could not be read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from acquisition.block import F8
from acquisition.errors import FormatError
from acquisition.recordings.sampling.samples import Rows, within
from acquisition.recordings.sampling.timing import tolerance_of
from acquisition.recordings.tables.contents import Arrays, Channel, Sheet
from acquisition.recordings.tables.table import EMPTY, EXPONENT, UNREAD, Table, read_table
from acquisition.recordings.units import time_power

__all__ = ["Pulled", "pull"]

_LONGEST_S = 1e10
_T = TypeVar("_T", bound=np.generic)


@dataclass(frozen=True, slots=True, eq=False)
class Pulled:
    """One channel's numbers.

    Parameters
    ----------
    printed : (n,) float64, s, or None
        Times as printed; None where there are none.
    tolerance : (n,) float64, s, or None
        Half the last digit of each time, where a header's formula is to be held against them.
    value : (n,) float64
        In the channel's unit times the power of ten asked for; NaN where unread or absent.
    rows : Rows
    time_resolution : float
        Last printed digit of a time, s.
    resolution : float
        Last printed digit of a value; 0 where it is binary.
    """

    printed: F8 | None
    tolerance: F8 | None
    value: F8
    rows: Rows
    time_resolution: float
    resolution: float


def pull(path: str, channel: Channel, power: int) -> Pulled:
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
        return _from_arrays(channel.source, power)
    return _from_sheet(path, channel, channel.source, power)


def _from_arrays(arrays: Arrays, power: int) -> Pulled:
    value = arrays.values / 10.0**-power if power else arrays.values.copy()
    t = None if arrays.t is None else arrays.t.copy()  # channels may share it, and it will be written to
    bad = np.zeros(value.size, bool) if t is None else ~np.isfinite(t)
    if bad.any():
        value[bad] = np.nan
    largest = 0.0 if t is None else float(np.fmax.reduce(np.abs(t), initial=0.0))
    return Pulled(t, None, value, Rows(bad, _no_line), max(float(np.spacing(largest)), 1e-12), 0.0)


def _no_line(row: int) -> int:  # noqa: ARG001
    """Return 0: binary files have no lines."""
    return 0


def _from_sheet(path: str, channel: Channel, sheet: Sheet, power: int) -> Pulled:
    time, shift = channel.time, _time_power(path, channel)
    # The first column of a sheet tells rows from remarks, whoever's it is, unless it is left empty.
    row = next(sheet.text.lines(sheet.start), None)
    leads = row is not None and row.text.split(sheet.delimiter or None)[:1] not in ([], [""])
    columns = list(dict.fromkeys([*([0] if leads else []), *([] if time is None else [time]), channel.column]))
    powers = {time: shift, channel.column: power}
    table = read_table(
        sheet.text,
        columns,
        sheet.delimiter,
        start=sheet.start,
        stop=sheet.stop,
        first_line=sheet.first_line,
        shifts=[powers.get(column, 0) for column in columns],
    )
    at = None if time is None else columns.index(time)
    empty = table.form[-1] == EMPTY
    if at is not None:
        empty &= (table.form[at] == EMPTY) | (table.form[at] == UNREAD)
    remark = empty & table.text
    keep = _present(table, at, channel.ragged) | remark
    if not (keep & ~remark).any():
        demand = f'expected rows of numbers for "{channel.name}", got none'
        raise FormatError(path, demand, "check that the export ended", line=sheet.first_line)
    kept = None if keep.all() else np.flatnonzero(keep)
    return _of_table(path, channel, table, kept, at, (shift, power), _some(_kept(remark, kept)))


def _of_table(
    path: str,
    channel: Channel,
    table: Table,
    kept: NDArray[np.int64] | None,
    at: int | None,
    powers: tuple[int, int],
    remark: NDArray[np.bool_] | None,
) -> Pulled:
    bad = _kept(table.form[-1] == UNREAD, kept)
    if remark is not None:
        bad |= remark
    printed = tolerance = None
    time_resolution = 0.0
    if at is not None:
        printed = _kept(table.values[at], kept)
        time_resolution = _resolution(printed, table.decimals[at], table.exponents[at], powers[0])
        if channel.formula is not None:
            tolerance = tolerance_of(printed, _kept(table.form[at], kept), powers[0], EXPONENT)
        if not within(printed, _LONGEST_S):
            bad |= ~(np.abs(printed) < _LONGEST_S)
    value = np.require(_kept(table.values[-1], kept), requirements="W")
    if bad.any():
        value = np.where(bad, np.nan, value)

    def line(row: int) -> int:
        return table.line(row if kept is None else int(kept[row]))

    if bad.all():
        demand = f'expected rows of numbers for "{channel.name}", got none in {bad.size} lines'
        raise FormatError(path, demand, "check that rows and headings belong together", line=line(0))
    cut = table.cut and bool(bad[-1]) and (kept is None or bool(kept[-1] == len(table) - 1))
    rows = Rows(bad, line, cut, table.last_cell, 0 if at is None else table.decimals[at], remark)
    resolution = _resolution(value, table.decimals[-1], table.exponents[-1], powers[1])
    return Pulled(printed, tolerance, value, rows, time_resolution, resolution)


def _time_power(path: str, channel: Channel) -> int:
    if channel.time is None or not channel.time_unit:
        return 0
    power = time_power(channel.time_unit)
    if power is None:
        demand = f'expected times in s, ms or us, got "{channel.time_unit}"'
        raise FormatError(path, demand, "export the times in seconds")
    return power


def _kept(column: NDArray[_T], rows: NDArray[np.int64] | None) -> NDArray[_T]:
    return column if rows is None else column[rows]


def _some(mask: NDArray[np.bool_]) -> NDArray[np.bool_] | None:
    return mask if mask.any() else None


def _present(table: Table, at: int | None, ragged: bool) -> NDArray[np.bool_]:
    """Tell rows that hold something of the channel: others belong to a longer one beside it."""
    empty = table.form[-1] == EMPTY
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
