"""Find the times of one channel: printed times in seconds, and the rate from these times, the header or the user."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.block import B1, F8
from acquisition.errors import FormatError
from acquisition.recordings.recording import Trap
from acquisition.recordings.sampling.samples import Rows, within
from acquisition.recordings.sampling.timing import (
    Timing,
    clock_traps,
    time_by_column,
    time_by_formula,
    time_by_rate,
    tolerance_of,
)
from acquisition.recordings.tables.contents import Arrays, Channel, Formula
from acquisition.recordings.tables.table import EXPONENT
from acquisition.recordings.units import TIMES, time_factor, time_power

__all__ = ["PrintedTimes", "last_digit", "power_of_times", "printed_times", "timing_of"]

_LONGEST_S = 1e10


@dataclass(frozen=True, slots=True, eq=False)
class PrintedTimes:
    """A column of times in seconds.

    Parameters
    ----------
    t : (n,) float64, s
        NaN if unknown.
    unknown : (n,) bool
        Mask of the rows without a time, or with a time of more than 1e10 s (three hundred years).
    resolution_s : float
        Size of the last printed digit, s.
    tolerance : (n,) float64 or None
        Half the last printed digit of each time, if the times are compared with a formula in the header.
    """

    t: F8
    unknown: B1
    resolution_s: float
    tolerance: F8 | None


def power_of_times(path: str, channel: Channel) -> int:
    """Return the power of ten that converts a channel's times to seconds; 0 for minutes and hours.

    Raises
    ------
    FormatError
        If the unit of time is unknown.
    """
    timed = channel.source.t is not None if isinstance(channel.source, Arrays) else channel.time is not None
    if not timed or not channel.time_unit:
        return 0
    power = time_power(channel.time_unit)
    if power is None:
        problem = f'expected times in one of {", ".join(TIMES)}, got "{channel.time_unit}"'
        raise FormatError(path, problem, "export the times in seconds")
    return power


def last_digit(values: F8, decimals: int, exponents: bool, power: int) -> float:
    """Return the size of the last printed digit of a column; with exponents, that of the largest number.

    Parameters
    ----------
    values : (n,) float64
        The numbers, multiplied by ``10**power``.
    decimals : int
        Number of printed decimals of the numbers or of their mantissas.
    exponents : bool
        Whether the numbers have exponents.
    power : int
    """
    if exponents:
        largest = float(np.fmax.reduce(np.abs(values), initial=0.0))
        power = int(np.floor(np.log10(largest))) if largest > 0 else power
    return float(f"1e{power - decimals}")


def printed_times(
    channel: Channel, printed: F8, form: NDArray[np.int8], decimals: int, exponents: bool, power: int
) -> PrintedTimes:
    """Read a channel's column of times.

    Parameters
    ----------
    channel : Channel
    printed : (n,) float64
        The numbers, multiplied by ``10**power``; NaN if unread. They may be overwritten later.
    form : (n,) int8
        See :class:`acquisition.recordings.tables.table.Table`.
    decimals, exponents, power : int, bool, int
        See :func:`last_digit`.
    """
    resolution = last_digit(printed, decimals, exponents, power)
    tolerance = None if channel.formula is None else tolerance_of(printed, form, power, EXPONENT)
    factor = time_factor(channel.time_unit)
    if factor != 1.0:
        printed, resolution = printed * factor, resolution * factor
    if within(printed, _LONGEST_S):
        return PrintedTimes(printed, np.zeros(printed.size, bool), resolution, tolerance)
    unknown = ~(np.abs(printed) < _LONGEST_S)  # true for a NaN
    return PrintedTimes(np.where(unknown, np.nan, printed), unknown, resolution, tolerance)


def timing_of(path: str, channel: Channel, rows: Rows, rate_hz: float | None) -> tuple[Timing, tuple[Trap, ...]]:
    """Return the rate and grid of a channel's times, and remarks on the times.

    The header's formula is used if it agrees with the column of times or there is no such column. Otherwise the column
    of times is used. Without either, the rate that the user gives is used.

    Raises
    ------
    NeedsAnswer
        If the rate is neither stated nor given.
    FormatError
        If the given rate contradicts the file.
    """
    traps: list[Trap] = []
    timing = None
    if channel.formula is not None:
        timing, traps = _by_formula(path, channel.formula, rows, rate_hz)
    if timing is None and rows.printed is not None:
        sound = rows.printed[~rows.unread] if rows.unread.any() else rows.printed
        timing = time_by_column(path, sound, rows.time_resolution, rate_hz)
        if not channel.time_unit and channel.formula is None:
            traps.append(Trap("unit_assumed", "the times have no unit: read as seconds"))
    if timing is None:
        timing = time_by_rate(path, rate_hz, "no column of times and no sampling interval")
    return timing, (*traps, *clock_traps(timing))


def _by_formula(path: str, formula: Formula, rows: Rows, rate_hz: float | None) -> tuple[Timing | None, list[Trap]]:
    """Return the timing by a header's formula (None if it is impossible or the column contradicts it), and remarks."""
    traps = []
    count = int(np.count_nonzero(~rows.remark))
    if formula.samples is not None and formula.samples != count:
        message = f"the header declares {formula.samples} samples, but there are {count} rows; all are kept"
        traps.append(Trap("stale_header", message, abs(formula.samples - count)))
    printed = rows.printed
    if printed is not None and rows.unread.any():
        printed = np.where(rows.unread, np.nan, printed)
    timing = time_by_formula(path, formula.start_s, formula.step_s, printed, rows.tolerance, rows.numbers, rate_hz)
    if timing is None:
        stated = f"the header states the times {formula.start_s:g} s + i * {formula.step_s:g} s"
        if printed is None:
            traps.append(Trap("stale_header", f"{stated}, which are impossible"))
        else:
            message = f"{stated}, but the column of times differs and is used"
            traps.append(Trap("stale_header", message, printed.size))
    return timing, traps
