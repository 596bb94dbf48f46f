"""From a column of a table and its times to samples: rows of the channel, times on their grid, flags and remarks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath

import numpy as np

from acquisition.block import F8, I8, Block, ClockKind, Flag, SourceInfo, SourceKind
from acquisition.errors import FormatError
from acquisition.recordings.reading import ReadOptions
from acquisition.recordings.recording import FormatIssue, Original, Recording
from acquisition.recordings.sampling.flags import (
    UNREAD_FLAGS,
    length_traps,
    line_of,
    place,
    row_traps,
    sample_traps,
    time_flags,
    unwrapped,
)
from acquisition.recordings.sampling.timing import ChannelRows, Timing, find_timing
from acquisition.recordings.tables.choose import choose_channel, measure
from acquisition.recordings.tables.numbers import EMPTY_CELL, I1, UNREAD_CELL, scaled, usual_decimals
from acquisition.recordings.tables.table import Column, Lines, Table, names_apart
from acquisition.recordings.tables.text import says_simulated
from acquisition.units import TIMES, Measure, time_unit

_LONGEST_S = 1e10
"""Times beyond three hundred years are no times."""
_FEWEST_PEAKS, _MOST_PEAKS, _SHARE_OF_PEAKS = 12, 300, 0.97
_HOUR_S, _DAY_S, _MOST_JUMPS, _SLOWEST_HZ = 3600.0, 86400.0, 10, 0.01


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """The samples of a chosen channel in SI units, a block, and the remarks on them and on the file.

    ``resolution`` is the size of the last printed digit of a value. ``lines`` are the line numbers of the samples, None
    for a binary file. ``malformed_rows`` counts rows that could not be read. ``quantum`` is the step of which all
    values are multiples, and ``error_m`` the usual error that the file states.
    """

    path: str
    table: Table
    column: Column
    measured: Measure
    block: Block
    timing: Timing
    resolution: float
    traps: tuple[FormatIssue, ...]
    lines: I8 | None
    malformed_rows: int
    quantum: float | None = None
    error_m: float | None = None

    @property
    def name(self) -> str:
        """The file's name without its folder."""
        return PurePath(self.path).name

    def recording(self, family: str, data: bytes) -> Recording:
        """Return the recording of these samples."""
        table, column, name = self.table, self.column, self.name
        kind: SourceKind = (
            "simulated" if says_simulated(f"{table.title} {table.run} {column.name} {name}") else "replay"
        )
        clock: ClockKind = "device" if self.timing.origin_s is None else "nominal"
        return Recording(
            format=family,
            path=self.path,
            info=SourceInfo(
                kind, name, self.timing.rate_hz, None, self.quantum, clock, self.error_m, self.timing.u_rate
            ),
            channel=column.name,
            samples=self.block,
            traps=self.traps,
            malformed_rows=self.malformed_rows,
            originals=(Original(name, data),),
            title=table.title,
            run=table.run,
            start_time=table.start_time,
        )


def read_channel(path: str, tables: Sequence[Table], answers: ReadOptions) -> Samples:
    """Choose a channel and read its samples."""
    if (rate_hz := answers.rate_hz) is not None and not (math.isfinite(rate_hz) and rate_hz > 0):
        raise FormatError(path, f"rate_hz must be a positive number, got {rate_hz!r}", "give the rate in hertz")
    table, column = choose_channel(path, names_apart(tables), answers)
    measured, traps = measure(path, column, answers.unit)
    rows = rows_of(path, table, column, measured)
    rows, jumps = _without_jumps(rows, column, measured)
    samples = read_samples(path, rows, table, column, measured, rate_hz)
    _refuse_peaks(path, samples.block.distance)
    return replace(samples, traps=(*table.traps, *traps, *jumps, *samples.traps))


def _without_jumps(rows: ChannelRows, column: Column, measured: Measure) -> tuple[ChannelRows, tuple[FormatIssue, ...]]:
    """Undo jumps of an angle by one turn, and of whole numbers by a power of two."""
    scale = 10.0**measured.power * measured.factor
    printed = rows.value / scale
    whole = not np.nanmax(np.abs(printed - np.rint(printed)), initial=0.0)
    turns = [2 * math.pi] if measured.quantity == "angle" else [2.0**bits * scale for bits in range(8, 33) if whole]
    value, count = unwrapped(rows.value, turns)
    if not count:
        return rows, ()
    message = f'{count} jumps of "{column.name}" by a full turn of its numbers were undone'
    return replace(rows, value=value), (FormatIssue("values_unwrapped", message, count),)


def _refuse_peaks(path: str, values: F8) -> None:
    """Refuse a table of turning points: every value is above or below both of its neighbours."""
    steps = np.diff(values[np.isfinite(values)])
    if _FEWEST_PEAKS <= steps.size <= _MOST_PEAKS and np.mean(steps[1:] * steps[:-1] < 0.0) >= _SHARE_OF_PEAKS:
        problem = f"expected samples of a motion, got {steps.size + 1} turning points, above and below in turn"
        raise FormatError(path, problem, "export all samples; the motion between the turning points is needed")


def read_samples(
    path: str,
    rows: ChannelRows,
    table: Table,
    column: Column,
    measured: Measure,
    rate_hz: float | None = None,
) -> Samples:
    """Return the samples in the rows of a channel."""
    timing = find_timing(path, rows, table.formula, rate_hz)
    issues = list(timing.traps)
    if table.formula is None and table.times is not None and not table.times.unit:
        issues.insert(0, FormatIssue("time_unit_assumed", "the times have no unit: read as seconds"))
    unread, t = rows.unread, place(rows, timing)
    timed = np.isfinite(t)
    t, value = t[timed], rows.value[timed]
    if np.isnan(value).all():
        problem = f'expected numbers as "{column.name}", got NaN in all {value.size} rows'
        raise FormatError(path, problem, "record the run again", line=line_of(rows.lines, 0))
    lines = None if rows.lines is None else rows.lines[timed]
    flags = time_flags(t, 1.0 / timing.rate_hz)
    flags[np.isnan(value)] |= Flag.MISSING.value
    flags[unread[timed]] |= UNREAD_FLAGS
    if column.differences and not unread[0] and np.isnan(value[0]):
        flags[0] &= ~np.uint8(Flag.MISSING)
    issues += _jumps(t, timing.rate_hz, lines)
    zeros = table.lines.zeros if table.lines else 0
    issues += [*row_traps(rows, timed, zeros), *sample_traps(flags, t, timing.rate_hz, lines)]
    block = Block(0, t, value, flags, quantity=measured.quantity, unit=measured.si)
    malformed = int(np.count_nonzero(unread))
    return Samples(path, table, column, measured, block, timing, rows.resolution, tuple(issues), lines, malformed)


def _jumps(t: F8, rate_hz: float, lines: I8 | None) -> list[FormatIssue]:
    """Report where a clock was set forward: by full hours, as for summer time, or by more than a day."""
    traps: list[FormatIssue] = []
    if rate_hz < _SLOWEST_HZ or float(t.max() - t.min()) < 0.5 * _HOUR_S:
        return traps
    steps = np.diff(t)
    for row in np.flatnonzero(steps > _HOUR_S - 2.0 / rate_hz)[:_MOST_JUMPS].tolist():
        step = float(steps[row])
        if step > _DAY_S or abs((step + 0.5 * _HOUR_S) % _HOUR_S - 0.5 * _HOUR_S) < 2.0 / rate_hz:
            where = f"samples {row + 1} and {row + 2}" if lines is None else f"lines {lines[row]} and {lines[row + 1]}"
            perhaps = "for summer time" if round(step) == _HOUR_S else "during the recording"
            message = f"the times jump by {step:.0f} s between {where}: the clock was perhaps set {perhaps}"
            traps.append(FormatIssue("time_jump", message, 1, line_of(lines, row + 1)))
    return traps


def check_lengths(samples: Samples) -> Samples:
    """Return lengths with their quantum and with what is peculiar in them; see :func:`length_traps`."""
    quantum, issues = length_traps(samples.block.distance, samples.block.flags, samples.resolution, samples.lines)
    return replace(samples, quantum=quantum or None, traps=(*samples.traps, *issues))


def rows_of(path: str, table: Table, column: Column, measured: Measure) -> ChannelRows:
    """Return the rows of a channel, including those that could not be read; raise an error if there are no numbers."""
    unit = table.times.unit if table.times else ""
    seconds = time_unit(unit or "s")
    if seconds is None:
        problem = f'expected times in one of {", ".join(TIMES)}, got "{unit}"'
        raise FormatError(path, problem, "export the times in seconds")
    if table.lines is None:
        return _binary_rows(table.times, column, measured, seconds)
    return _text_rows(path, table, table.lines, column, measured, seconds)


def _binary_rows(times: Column | None, column: Column, measured: Measure, seconds: Measure) -> ChannelRows:
    size = max(column.values.size, times.values.size if times else 0)
    value, t, unread = scaled(column.of_size(size).values, None, measured.power), None, np.zeros(size, bool)
    value *= measured.factor
    if times is not None:
        t = scaled(times.of_size(size).values * seconds.factor, None, seconds.power)
        unread = ~np.isfinite(t)
    value[unread] = np.nan
    largest = 0.0 if t is None else float(np.fmax.reduce(np.abs(t), initial=0.0))
    return ChannelRows(t, value, unread, np.zeros(size, bool), None, max(float(np.spacing(largest)), 1e-12), 0.0)


def _text_rows(
    path: str, table: Table, lines: Lines, column: Column, measured: Measure, seconds: Measure
) -> ChannelRows:
    values, time = column.of_size(lines.rows), table.times and table.times.of_size(lines.rows)
    form = values.forms
    # A row of words without a value is a remark between rows; a row of a longer channel is none of this channel's.
    remark, present, unread = lines.words & (form == EMPTY_CELL), np.ones(form.size, bool), form == UNREAD_CELL
    if time is not None:
        remark &= (time.forms == EMPTY_CELL) | (time.forms == UNREAD_CELL)
        present = (form != EMPTY_CELL) | (time.forms != EMPTY_CELL)
        if lines.cut and time.forms[-1] == UNREAD_CELL:
            unread[-1] = True  # its time is incomplete
    if table.ragged or time is None:
        # Empty cells at the end follow the channel's last sample; an empty cell before it is a lost sample.
        filled = np.flatnonzero(form != EMPTY_CELL)
        present[int(filled[-1]) + 1 if filled.size else 0 :] = False
    keep = present | remark
    if not (keep & ~remark).any():
        raise _no_numbers(path, column, 0, int(lines.numbers[0]) if lines.rows else None)
    remark, unknown = remark[keep], (unread | remark)[keep]
    printed, time_digit = None, 0.0
    if time is not None:
        printed = scaled(time.values, time.forms, seconds.power)[keep]
        time_digit = last_digit(printed, time.forms, seconds.power)
        printed, time_digit = printed * seconds.factor, time_digit * seconds.factor
        beyond = ~(np.abs(printed) < _LONGEST_S)  # true for a NaN
        printed[beyond] = np.nan
        unknown |= beyond
    value = scaled(values.values, form, measured.power)[keep]
    value[unknown] = np.nan
    resolution = last_digit(value, form, measured.power) * measured.factor
    value *= measured.factor

    numbers = lines.numbers[keep]
    if unknown.all():
        raise _no_numbers(path, column, unknown.size, int(numbers[0]))
    return ChannelRows(
        printed=printed,
        value=value,
        unread=unknown,
        remark=remark,
        lines=numbers,
        time_resolution=time_digit,
        resolution=resolution,
        cut=lines.cut and bool(unknown[-1]) and bool(keep[-1]),
    )


def _no_numbers(path: str, column: Column, rows: int, line: int | None) -> FormatError:
    problem = f'expected rows of numbers for "{column.name}", got none' + (f" in {rows} lines" if rows else "")
    remedy = "check that rows and headings belong together" if rows else "check that the export ended"
    return FormatError(path, problem, remedy, line=line)


def last_digit(values: F8, decimals: I1, power: int) -> float:
    """Return the size of the last printed digit of numbers that were multiplied by ten to a power.

    If the numbers have exponents, it is that of the largest number.
    """
    usual, exponents = usual_decimals(decimals)
    if exponents:
        largest = float(np.fmax.reduce(np.abs(values), initial=0.0))
        power = int(np.floor(np.log10(largest))) if largest > 0 else power
    return float(f"1e{power - usual}")
