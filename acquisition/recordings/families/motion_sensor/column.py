"""One MotionSensor.vi file as arrays, with everything that was seen on the way."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.block import F8, U8, Flag
from acquisition.errors import FormatError
from acquisition.recordings.families.motion_sensor.layout import Layout, ask_columns, find_layout
from acquisition.recordings.recording import Trap
from acquisition.recordings.sampling.samples import Rows, flags_of, place, row_traps, sample_traps, value_traps, within
from acquisition.recordings.sampling.timing import Timing, check_rate, clock_traps, time_by_column
from acquisition.recordings.sampling.velocity import find_tick
from acquisition.recordings.tables.table import Table, read_table
from acquisition.recordings.tables.text import says_simulated, text_of

__all__ = ["Column", "read_column"]

_LONGEST_S = 1e7
_CONSTANT = 0.95


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """Times and one quantity.

    Parameters
    ----------
    path : str
    data : bytes
    layout : Layout
    t : (n,) float64, s
    value : (n,) float64, m or m/s
        NaN where not measured or not readable.
    flags : (n,) uint8
    timing : Timing
    resolution : float
        Last printed digit of the quantity, m or m/s.
    quantum : float
        Step that all distances are multiples of, m: the last printed digit or a multiple of it.
    stated_error_m : float or None
    malformed : int
        Rows that could not be read.
    traps : tuple of Trap
    """

    path: str
    data: bytes
    layout: Layout
    t: F8
    value: F8
    flags: U8
    timing: Timing
    resolution: float
    quantum: float
    stated_error_m: float | None
    malformed: int
    traps: tuple[Trap, ...]

    @property
    def name(self) -> str:
        """The file's name without its folder."""
        return os.path.basename(self.path)

    @property
    def simulated(self) -> bool:
        """Whether the title or the file's name says that nobody measured this."""
        return says_simulated(f"{self.layout.title} {self.name}")

    def tick(self) -> float | None:
        """Return the step that all values are multiples of, m or m/s, if one is evident."""
        return find_tick(self.value, self.resolution)


def read_column(path: str, data: bytes, channel: str | None, rate_hz: float | None, unit: str | None) -> Column:
    """Read one file; for the arguments and errors see :class:`acquisition.recordings.base.Format`."""
    check_rate(path, rate_hz)
    text = text_of(path, data)
    layout = find_layout(path, text, channel, unit)
    power = -round(math.log10(layout.per_si))
    table = read_table(
        text,
        range(layout.columns),
        layout.delimiter,
        width=layout.columns,
        start=layout.body,
        first_line=layout.first_line,
        shifts=(0, power, power)[: layout.columns],
    )
    printed = table.values[0]
    bad = table.bad
    if not within(printed, _LONGEST_S):
        bad = bad | ~(np.abs(printed) < _LONGEST_S)
    any_bad = bool(bad.any())
    _demand_rows(path, layout, table, bad)
    timing = time_by_column(path, printed[~bad] if any_bad else printed, 10.0 ** -table.decimals[0], rate_hz)
    rows = Rows(bad, table.line, table.cut, table.last_cell, table.decimals[0])
    t = place(np.where(np.abs(printed) < _LONGEST_S, printed, np.nan) if any_bad else printed, rows, timing)
    told = np.isfinite(t)
    value = np.require(table.values[1], requirements="W")
    if any_bad:
        value = np.where(bad, np.nan, value)
    where = None if told.all() else np.flatnonzero(told)
    if where is not None:
        t, value = t[where], value[where]
    if np.isnan(np.fmax.reduce(value)):
        demand = f"expected numbers as {layout.quantity}, got NaN in all {value.size} rows"
        raise FormatError(path, demand, "record the run again", line=table.line(0))

    def line(row: int) -> int:
        return table.line(row if where is None else int(where[row]))

    flags = flags_of(t, value, bad if where is None else bad[where], timing.rate_hz)
    if layout.quantity == "velocity" and not bad[0] and np.isnan(value[0]):
        flags[0] &= ~np.uint8(Flag.MISSING)  # the first velocity has nothing to differ from: NaN is right there
    resolution = 10.0 ** -table.decimals[1] / layout.per_si
    quantum = resolution
    found: tuple[Trap, ...] = ()
    if layout.quantity == "distance":
        quantum, found = value_traps(value, flags, resolution, line)
    stated, constant = _stated_error(path, layout, table, bad)
    traps = (
        *_layout_traps(layout),
        *clock_traps(timing),
        *_error_traps(layout, stated, constant),
        *row_traps(rows, told, text.zeros),
        *sample_traps(flags, t, timing.rate_hz, line),
        *found,
    )
    malformed = int(np.count_nonzero(bad)) if any_bad else 0
    return Column(path, data, layout, t, value, flags, timing, resolution, quantum, stated, malformed, traps)


def _demand_rows(path: str, layout: Layout, table: Table, bad: NDArray[np.bool_]) -> None:
    if bad.all():
        demand = f"expected rows of {layout.columns} numbers, got none in {bad.size} lines"
        remedy = "check that rows and column line belong together"
        raise FormatError(path, demand, remedy, line=table.line(0) if bad.size else layout.first_line)


def _stated_error(path: str, layout: Layout, table: Table, bad: NDArray[np.bool_]) -> tuple[float | None, bool]:
    """Return the usual error of the file, m, and whether it is constant."""
    if layout.columns < 3:
        return None, False
    stated = table.values[2]
    if bad.any():
        stated = stated[~bad]
    first = float(stated[0])
    if (stated == first).all():
        return first, True
    stated = stated[np.isfinite(stated)]
    if stated.size == 0:
        return None, False
    median = float(np.sort(stated)[stated.size // 2])
    constant = bool(np.mean(stated == median) >= _CONSTANT)
    if layout.assumed and not constant:
        raise ask_columns(path, "three columns that all vary", layout.first_line)
    return median, constant


def _layout_traps(layout: Layout) -> Iterator[Trap]:
    if layout.assumed:
        yield Trap("unit_assumed", f"no column line: read as time (s) and {layout.assumed}, in {layout.unit}")


def _error_traps(layout: Layout, stated: float | None, constant: bool) -> Iterator[Trap]:
    if stated is not None and constant:
        figure = f"{stated * layout.per_si:g} {layout.unit}"
        yield Trap(
            "stated_error_is_not_noise",
            f"the error column is a constant {figure}: a stated figure, not the noise",
        )
