"""From columns as printed to samples with times and flags, and what is to be said of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.block import F8, I8, U8, Flag
from acquisition.recordings.recording import Trap
from acquisition.recordings.sampling.nominal import median, place_unread, snap, time_flags
from acquisition.recordings.sampling.timing import Timing

__all__ = [
    "IRREGULAR",
    "UNREAD_FLAGS",
    "Rows",
    "flags_of",
    "place",
    "row_traps",
    "sample_traps",
    "value_traps",
    "within",
]

IRREGULAR = np.uint8(Flag.DUPLICATE_TIME | Flag.NON_MONOTONIC_TIME)
UNREAD_FLAGS = np.uint8(Flag.MALFORMED | Flag.MISSING)

_COARSE_M = 1e-3
_FAR_SPREADS, _FAR_GAP = 30.0, 3.0  # how far off a lost target reads: times the usual, and times the next nearest
_SAMPLE = 65536
_FEWEST = 50  # distances; with fewer, a common step may be chance
_ZEROS = 10


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """One channel's rows as samples to be.

    Parameters
    ----------
    printed : (n,) float64, s, or None
        Times as printed; None where there are none.
    value : (n,) float64
        In the channel's unit times the power of ten asked for; NaN where unread or absent.
    bad, remark : (n,) bool
        Rows that could not be read, and rows of text between samples, which are none.
    line : callable
        Gives the one-based line of a row.
    time_resolution, resolution : float
        Last printed digit of a time, s, and of a value; the latter 0 where it is binary.
    tolerance : (n,) float64, s, or None
        Half the last digit of each time, where a header's formula is to be held against them.
    cut : bool
        Whether the last row stops midway.
    last_cell : str
        The first cell of the last row.
    decimals : int
        Decimals that a time is printed with.
    behind : tuple of (n,) float64
        The columns behind the value, of a sheet whose rows have a width.
    """

    printed: F8 | None
    value: F8
    bad: NDArray[np.bool_]
    remark: NDArray[np.bool_]
    line: Callable[[int], int]
    time_resolution: float
    resolution: float
    tolerance: F8 | None = None
    cut: bool = False
    last_cell: str = ""
    decimals: int = 0
    behind: tuple[F8, ...] = ()

    @property
    def numbers(self) -> I8:
        """Numbers of the rows as samples, counted without remarks; that of a remark is that of the row before."""
        return np.cumsum(~self.remark) - 1


def place(rows: Rows, timing: Timing) -> F8:
    """Return the time of each row, s: of its number, or as printed and snapped to the grid; of a bad row where it is
    told, else NaN.

    The times printed are overwritten.
    """
    bad, t, grid = rows.bad, rows.printed, timing.grid
    if grid is not None and (timing.by_row or t is None):
        t = grid.time(rows.numbers)
        t[rows.remark] = np.nan
        return t
    if t is None:
        raise ValueError("without times only a grid has times of rows")
    if not bad.any():
        return t if grid is None else snap(t, grid, timing.resolution_s, out=t)[0]
    if grid is not None:
        t[~bad] = snap(t[~bad], grid, timing.resolution_s)[0]
    expected = {bad.size - 1: rows.last_cell} if bad[-1] else {}
    return place_unread(t, bad, grid, expected, rows.decimals)


def within(values: F8, limit: float) -> bool:
    """Tell whether there are values and all of them, no NaN among them, lie within a limit on either side."""
    return bool(values.size and values.min() > -limit and values.max() < limit)  # a NaN is neither


def flags_of(t: F8, value: F8, bad: NDArray[np.bool_], rate_hz: float) -> U8:
    """Flag what is wrong with times and values."""
    flags = time_flags(t, 1.0 / rate_hz)
    missing = np.isnan(value)
    if missing.any():
        flags[missing] |= Flag.MISSING.value
    if bad.any():
        flags[bad] |= UNREAD_FLAGS
    return flags


def row_traps(rows: Rows, told: NDArray[np.bool_], zeros: int) -> Iterator[Trap]:
    """Say which rows could not be read; ``told`` are those that stand as samples."""
    if zeros:
        yield Trap("zero_filled_tail", f"the file ends in {zeros} zero bytes, left out: its writer was interrupted")
    bad = rows.bad
    last = bad.size - 1
    if rows.cut:
        kept = "kept as a missing sample" if told[last] else "its time is not told, so no sample stands for it"
        yield Trap("truncated_row", f"the last row stops midway; {kept}", 1, rows.line(last))
    found = np.flatnonzero(bad[:-1] if rows.cut else bad)
    if found.size:
        first = rows.line(int(found[0]))
        kept_rows = int(np.count_nonzero(told[found]))
        message = (
            f"{found.size} rows could not be read, the first in line {first}; {kept_rows} of them are kept as "
            "missing samples, the others show no sign of having been samples"
        )
        yield Trap("malformed_rows", message, int(found.size), first)


def sample_traps(flags: U8, t: F8, rate_hz: float, line: Callable[[int], int | None]) -> Iterator[Trap]:
    """Count what was flagged; ``line`` gives the line of a sample."""
    if not flags.any():
        return
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
            yield Trap(code, f"{rows.size} {what}; kept and flagged", int(rows.size), line(int(rows[0])))
    gaps = np.flatnonzero(flags & Flag.GAP_BEFORE.value)
    if gaps.size:
        reached = np.maximum.accumulate(np.where(flags & IRREGULAR, -np.inf, t))
        lost = int(np.sum(np.rint((t[gaps] - reached[gaps - 1]) * rate_hz) - 1))
        message = f"about {lost} samples are missing in {gaps.size} gaps of time; the sample after each is flagged"
        yield Trap("missing_samples", message, lost, line(int(gaps[0])))


def value_traps(
    distance: F8, flags: U8, resolution: float, line: Callable[[int], int | None], *, length: bool = True
) -> tuple[float, tuple[Trap, ...]]:
    """Look for distances that are rounded more coarsely than they are printed, and for a target that was lost.

    Parameters
    ----------
    distance : (n,) float64, m
        Zeros that fill the end become NaN here.
    flags : (n,) uint8
        Samples of a lost target get FALSE_ECHO here, zeros that fill the end MISSING.
    resolution : float
        Last printed digit, m.
    line : callable
    length : bool
        Whether these are distances at all; of volts no target is lost, and 0 V is a reading.

    Returns
    -------
    quantum_m : float
    traps : tuple of Trap
    """
    traps = []
    if length and (tail := _zero_tail(distance)) < distance.size:
        count = distance.size - tail
        distance[tail:] = np.nan
        flags[tail:] |= Flag.MISSING.value
        message = f"the last {count} distances are exactly 0, which no rangefinder reads; kept as missing samples"
        traps.append(Trap("zero_filled_tail", message, count, line(tail)))
    far = _far(distance, resolution) if length else np.empty(0, np.int64)
    if far.size:
        flags[far] |= Flag.FALSE_ECHO.value
        low, high = float(np.min(distance[far])), float(np.max(distance[far]))
        message = (
            f"{far.size} distances of {low:.3g} to {high:.3g} m lie far off all others, and nothing between: "
            "the target was lost; kept and flagged"
        )
        traps.append(Trap("lost_target", message, int(far.size), line(int(far[0]))))
    quantum = _common_step(distance, resolution)
    if length and quantum >= _COARSE_M * (1 - 1e-9):
        message = f"distances are multiples of {quantum * 1e3:g} mm: finer motion is rounded away"
        traps.append(Trap("quantised", message, distance.size))
    return quantum, tuple(traps)


def _zero_tail(distance: F8) -> int:
    """Return where zeros that fill the end begin; the number of samples where there are none."""
    if distance.size <= _ZEROS or distance[-1] != 0.0 or distance[-_ZEROS:].any():
        return int(distance.size)
    other = np.flatnonzero(distance != 0.0)
    return int(other[-1]) + 1 if other.size else int(distance.size)


def _some(values: F8) -> F8:
    """Return at most a few ten thousand finite values, evenly spread."""
    some = values[:: max(1, values.size // _SAMPLE)]
    return some[np.isfinite(some)]


def _far(distance: F8, resolution: float) -> NDArray[np.int64]:
    """Return the samples far off the median, compared with how far the others are, with nothing between.

    No length is far by itself, nobody knowing how large an experiment is; a motion that dies away has no gap.
    """
    some, none = _some(distance), np.empty(0, np.int64)
    if some.size < _ZEROS:
        return none
    middle = median(some)
    least = _FAR_SPREADS * max(median(np.abs(some - middle)), resolution)
    away = np.abs(distance - middle)
    if least == 0.0 or not np.fmax.reduce(away) > least:
        return none
    ordered = np.sort(away[np.isfinite(away)])
    first = int(np.searchsorted(ordered, least, side="right"))
    gaps = np.flatnonzero(ordered[first:] > _FAR_GAP * np.maximum(ordered[first - 1 : -1], least / _FAR_SPREADS))
    return np.flatnonzero(away >= ordered[first + gaps[0]]) if gaps.size else none


def _common_step(distance: F8, resolution: float) -> float:
    """Return the largest step that all distances are multiples of: the last printed digit, or some multiple of it."""
    if not resolution > 0 or distance.size < _FEWEST:
        return resolution
    for values in (distance[:4096], distance):
        finite = values[np.isfinite(values)]
        digits = np.rint(finite / resolution)
        if not digits.size or np.abs(digits).max() > 2.0**52:
            return resolution
        step = int(np.gcd.reduce(digits.astype(np.int64)))
        if step <= 1 or np.ptp(digits) == 0:
            return resolution
    return step * resolution
