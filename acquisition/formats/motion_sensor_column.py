"""One MotionSensor.vi file as arrays, with everything that was seen on the way."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import PurePath

import numpy as np
from numpy.typing import NDArray

from acquisition.block import F8, U8, Flag
from acquisition.errors import FormatError, NeedsAnswer
from acquisition.formats.motion_sensor_layout import Layout, ask_columns, find_layout
from acquisition.formats.nominal import Grid, find_rate, place_unread, snap, time_flags
from acquisition.formats.text import Table, decode, is_text, read_table, unify
from acquisition.formats.velocity import find_tick
from acquisition.recording import Trap

__all__ = ["IRREGULAR", "UNREAD", "Column", "read_column"]

IRREGULAR = np.uint8(Flag.DUPLICATE_TIME | Flag.NON_MONOTONIC_TIME)
UNREAD = np.uint8(Flag.MALFORMED | Flag.MISSING)
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
    stated_error_m: float | None
    malformed: int
    traps: tuple[Trap, ...]

    @property
    def name(self) -> str:
        """The file's name without its folder."""
        return PurePath(self.path).name

    @property
    def simulated(self) -> bool:
        """Whether the title or the file's name says that nobody measured this."""
        # The form has no place for it, so the name counts too: simulated must not pass for measured.
        return re.search(r"simulat|synthe", f"{self.layout.title} {self.name}", re.IGNORECASE) is not None

    def tick(self) -> float | None:
        """Return the step that all values are multiples of, m or m/s, if one is evident."""
        return find_tick(self.value, self.resolution)


@dataclass(frozen=True, slots=True)
class Timing:
    """Rate and grid of a file's times.

    Parameters
    ----------
    rate_hz : float
    grid : Grid or None
        None where the times fit no grid and stand as printed.
    resolution_s : float
        Last printed digit, s.
    certain : bool
        Whether the times settle the rate.
    """

    rate_hz: float
    grid: Grid | None
    resolution_s: float
    certain: bool


def read_column(
    path: str, data: bytes, channel: str | None, rate_hz: float | None, unit: str | None, *, fast: bool = True
) -> Column:
    """Read one file; for the arguments and errors see :class:`acquisition.formats.base.Format`."""
    if not is_text(data):
        raise FormatError(path, "expected rows of text, got binary data", "export the run as text again")
    if rate_hz is not None and not (math.isfinite(rate_hz) and rate_hz > 0):
        raise NeedsAnswer(path, f"rate_hz must be a positive number, got {rate_hz!r}", "give the rate in hertz")
    whole = unify(decode(data))
    text = whole.rstrip("\0\x1a")
    layout = find_layout(path, text, channel, unit)
    table = read_table(text[layout.body :], layout.columns, layout.delimiter, layout.first_line, fast=fast)
    printed = table.values[:, 0]
    bad = table.bad | ~(np.abs(printed) < _LONGEST_S)
    _demand_rows(path, layout, table, bad)
    timing = _timing(path, printed[~bad], 10.0 ** -table.decimals[0], rate_hz)
    t = np.where(np.abs(printed) < _LONGEST_S, printed, np.nan)
    if timing.grid is not None:
        t[~bad] = snap(t[~bad], timing.grid, timing.resolution_s)[0]
    t = place_unread(t, bad, timing.grid, table.unread, table.decimals[0])
    told = np.isfinite(t)
    value = np.where(bad, np.nan, _to_si(table.values[:, 1], table.decimals[1], layout.per_si))[told]
    if np.isnan(value).all():
        demand = f"expected numbers as {layout.quantity}, got NaN in all {value.size} rows"
        raise FormatError(path, demand, "record the run again", line=int(table.line[0]))
    flags = _flags(t[told], value, bad[told], layout, timing)
    stated, constant = _stated_error(path, layout, table, bad)
    traps = (
        *_layout_traps(layout, timing, stated, constant, rate_hz),
        *_row_traps(table, bad, told, ended=text.endswith("\n"), zeros=len(whole) - len(text)),
        *_sample_traps(flags, table.line[told], t[told], timing),
    )
    malformed = int(np.count_nonzero(bad))
    resolution = 10.0 ** -table.decimals[1] / layout.per_si
    return Column(path, data, layout, t[told], value, flags, timing, resolution, stated, malformed, traps)


def _demand_rows(path: str, layout: Layout, table: Table, bad: NDArray[np.bool_]) -> None:
    good = int(np.count_nonzero(~bad))
    if good == 0:
        demand = f"expected rows of {layout.columns} numbers, got none in {bad.size} lines"
        remedy = "check that rows and column line belong together"
        raise FormatError(path, demand, remedy, line=int(table.line[0]) if bad.size else layout.first_line)


def _timing(path: str, printed: F8, resolution: float, rate_hz: float | None) -> Timing:
    rate = find_rate(printed, resolution, rate_hz=rate_hz)
    if rate is None:
        if rate_hz is None:
            demand = f"expected times to tell the rate, got {printed.size} rows at one time"
            raise NeedsAnswer(path, demand, "record longer, or give rate_hz (--rate-hz)")
        return Timing(rate_hz, Grid(rate_hz, float(printed[0])), resolution, certain=False)
    if rate_hz is not None:
        if abs(rate.rate_hz - rate_hz) > rate_hz * (1.5 * rate.relative_u + 1e-6):
            demand = f"rate_hz {rate_hz:g} was given, but the times say {rate.rate_hz:.6g} Hz"
            raise FormatError(path, demand, "leave the rate out or correct it")
        return Timing(rate_hz, rate.grid, resolution, certain=True)
    return Timing(rate.rate_hz, rate.grid, resolution, rate.certain)


def _flags(t: F8, value: F8, bad: NDArray[np.bool_], layout: Layout, timing: Timing) -> U8:
    flags = time_flags(t, 1.0 / timing.rate_hz)
    missing = np.isnan(value)
    if layout.quantity == "velocity" and not bad[0]:
        missing[0] = False  # the first velocity has nothing to differ from: NaN is right there
    flags[missing] |= Flag.MISSING.value
    flags[bad] |= UNREAD
    return flags


def _stated_error(path: str, layout: Layout, table: Table, bad: NDArray[np.bool_]) -> tuple[float | None, bool]:
    """Return the usual error of the file, m, and whether it is constant."""
    if layout.columns < 3:
        return None, False
    stated = table.values[~bad, 2]
    stated = stated[np.isfinite(stated)]
    if stated.size == 0:
        return None, False
    median = float(np.sort(stated)[stated.size // 2])
    constant = bool(np.mean(stated == median) >= _CONSTANT)
    if layout.assumed and not constant:
        raise ask_columns(path, "three columns that all vary", layout.first_line)
    return float(_to_si(np.array([median]), table.decimals[2], layout.per_si)[0]), constant


def _to_si(printed: F8, decimals: int, per_si: float) -> F8:
    """Convert as a decimal fraction: 16.509 cm is the float 0.16509, which 16.509 / 100 is not."""
    digits = np.rint(printed * 10.0**decimals)
    exact = (digits / 10.0**decimals == printed) & (np.abs(digits) < 2.0**53)
    return np.where(exact, digits / (10.0**decimals * per_si), printed / per_si)


def _layout_traps(
    layout: Layout, timing: Timing, stated: float | None, constant: bool, rate_hz: float | None
) -> Iterator[Trap]:
    if layout.assumed:
        yield Trap("unit_assumed", f"no column line: read as time (s) and {layout.assumed}, in {layout.unit}")
    if timing.grid is not None:
        message = f"times are row numbers over a nominal {timing.rate_hz:g} Hz, not measured times"
        yield Trap("nominal_clock", message)
    if rate_hz is not None:
        yield Trap("rate_assumed", f"the rate of {rate_hz:g} Hz was given by the user")
    elif not timing.certain:
        why = (
            "too few rows settle it"
            if timing.grid is not None
            else "the times fit no regular grid and stand as printed"
        )
        yield Trap("rate_assumed", f"the rate of {timing.rate_hz:g} Hz is the likeliest: {why}")
    if stated is not None and constant:
        figure = f"{stated * layout.per_si:g} {layout.unit}"
        yield Trap(
            "stated_error_is_not_noise",
            f"the error column is a constant {figure}: a stated figure, not the noise",
        )


def _row_traps(
    table: Table, bad: NDArray[np.bool_], told: NDArray[np.bool_], *, ended: bool, zeros: int
) -> Iterator[Trap]:
    if zeros:
        yield Trap("zero_filled_tail", f"the file ends in {zeros} zero bytes, left out: its writer was interrupted")
    last = bad.size - 1
    cut = bool(bad[last]) and not ended
    if cut:
        kept = "kept as a missing sample" if told[last] else "its time is not told, so no sample stands for it"
        yield Trap("truncated_row", f"the last row stops midway; {kept}", 1, int(table.line[last]))
    rows = np.flatnonzero(bad[:-1] if cut else bad)
    if rows.size:
        first = int(table.line[rows[0]])
        kept_rows = int(np.count_nonzero(told[rows]))
        message = (
            f"{rows.size} rows could not be read, the first in line {first}; {kept_rows} of them are kept as "
            "missing samples, the others show no sign of having been samples"
        )
        yield Trap("malformed_rows", message, int(rows.size), first)


def _sample_traps(flags: U8, line: NDArray[np.int64], t: F8, timing: Timing) -> Iterator[Trap]:
    found = (
        ("duplicate_time", Flag.DUPLICATE_TIME, "samples repeat a time"),
        (
            "non_monotonic_time",
            Flag.NON_MONOTONIC_TIME,
            "samples run back in time or ahead of those around them",
        ),
        ("missing_samples", Flag.MISSING, "samples have no value"),
    )
    for code, flag, what in found:
        rows = np.flatnonzero(flags & flag.value)
        if rows.size:
            yield Trap(code, f"{rows.size} {what}; kept and flagged", int(rows.size), int(line[rows[0]]))
    gaps = np.flatnonzero(flags & Flag.GAP_BEFORE.value)
    if gaps.size:
        reached = np.maximum.accumulate(np.where(flags & IRREGULAR, -np.inf, t))
        lost = int(np.sum(np.rint((t[gaps] - reached[gaps - 1]) * timing.rate_hz) - 1))
        message = f"about {lost} samples are missing in {gaps.size} gaps of time; the sample after each is flagged"
        yield Trap("missing_samples", message, lost, int(line[gaps[0]]))
