"""Find the times of samples from printed times, a formula in the header or a given rate, and report on them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from acquisition.block import F8, I8
from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.questions import Missing, MissingItem, Question
from acquisition.recordings.recording import Trap
from acquisition.recordings.sampling.bursts import Bursts, find_bursts
from acquisition.recordings.sampling.nominal import Grid, find_rate

_SHARE_OF_JITTER = 0.2
_ANY_RATE_HZ = 100.0  # an example: the rate of many sensors


class Timing(NamedTuple):
    """Rate and grid of a file's times; no grid if the times fit none and are used as printed.

    The rate is ``certain`` if the times or a header determine it, and ``given`` if the user gave it. ``steps_s`` is
    the range of the time steps (5th to 95th percentile) if the times fit no grid but jitter little about one step.
    ``by_row`` says that times computed from row numbers are better than the printed times.
    """

    rate_hz: float
    grid: Grid | None
    resolution_s: float
    certain: bool
    given: bool = False
    steps_s: tuple[float, float] | None = None
    by_row: bool = False
    bursts: Bursts | None = None


def check_rate(path: str, rate_hz: float | None) -> None:
    """Check that a rate, if given, is a positive number."""
    if rate_hz is not None and not (math.isfinite(rate_hz) and rate_hz > 0):
        raise FormatError(path, f"rate_hz must be a positive number, got {rate_hz!r}", "give the rate in hertz")


def rate_needed(instead: MissingItem | None = None) -> MissingItem:
    """Return the missing item for a rate; a column of times may be given instead."""
    return MissingItem(Missing.RATE_HZ, (), _ANY_RATE_HZ, instead=instead)


def time_by_column(path: str, printed: F8, resolution: float, rate_hz: float | None) -> Timing:
    """Infer the rate from the printed times (s) of valid rows; ask for it if they do not show it."""
    if (bursts := find_bursts(printed)) is not None:
        return _spread(path, bursts, resolution, rate_hz)
    rate = find_rate(printed, resolution, rate_hz=rate_hz)
    if rate is None:
        if rate_hz is None:
            reason = f"expected different times, got {printed.size} rows at one time"
            raise NeedsAnswer(Question(path, (rate_needed(),), reason=reason))
        origin = float(printed[0]) if printed.size else 0.0
        return Timing(rate_hz, Grid(rate_hz, origin), resolution, certain=False, given=True)
    steps = _jitter(printed) if rate.grid is None else None
    if rate_hz is not None:
        allowed = rate_hz * (1.5 * rate.relative_u + 1e-6 + (0.01 if steps else 0.0))
        if abs(rate.rate_hz - rate_hz) > allowed:
            problem = f"rate_hz must agree with the times, {rate.rate_hz:.6g} Hz, got {rate_hz:g}"
            raise FormatError(path, problem, "leave the rate out or correct it")
        return Timing(rate_hz, rate.grid, resolution, certain=True, given=True, steps_s=steps)
    return Timing(rate.rate_hz, rate.grid, resolution, rate.certain, steps_s=steps)


def _spread(path: str, bursts: Bursts, resolution: float, rate_hz: float | None) -> Timing:
    """Return a timing with evenly spaced times for samples that were stamped in bursts."""
    if rate_hz is None and not bursts.complete:
        each = f"{bursts.size:.3g} samples every {1e3 * bursts.interval_s:.3g} ms"
        raise NeedsAnswer(Question(path, (rate_needed(),), reason=f"the times come in bursts of {each}, some missing"))
    rate = rate_hz or 1.0 / bursts.step_s
    grid = Grid(rate, bursts.first_s)
    return Timing(rate, grid, resolution, certain=True, given=rate_hz is not None, by_row=True, bursts=bursts)


def _jitter(printed: F8) -> tuple[float, float] | None:
    """Return the 5th and 95th percentiles of the time steps if these differ little; else None."""
    steps = np.diff(printed)
    steps = steps[steps > 0]
    if steps.size < 2:
        return None
    low, middle, high = (float(x) for x in np.percentile(steps, (5, 50, 95)))
    return (low, high) if high - low <= _SHARE_OF_JITTER * middle else None


def time_by_formula(
    path: str,
    start_s: float,
    step_s: float,
    printed: F8 | None,
    tolerance: F8 | None,
    numbers: I8,
    rate_hz: float | None,
) -> Timing | None:
    """Use the times ``start_s + i step_s`` of a header; None if they are impossible or the column of times differs.

    ``printed`` are the times of the rows (NaN if unread), ``tolerance`` is half the last digit of each, and
    ``numbers`` is the index i of each row.
    """
    if not (math.isfinite(start_s) and math.isfinite(step_s) and 1e-12 < step_s < 1e12):
        return None
    if printed is not None and tolerance is not None:
        expected = start_s + step_s * numbers
        slack = 1e-9 * np.maximum(np.abs(expected), step_s)
        if (np.abs(printed - expected) > tolerance * 1.0001 + slack).any():  # the comparison is false for a NaN
            return None
    rate = 1.0 / step_s
    rounded = float(f"{rate:.9g}")
    rate = rounded if math.isclose(rounded, rate, rel_tol=1e-12) else rate
    if rate_hz is not None and abs(rate - rate_hz) > 1e-6 * rate:
        problem = f"rate_hz must agree with the header, {rate:.6g} Hz, got {rate_hz:g}"
        raise FormatError(path, problem, "leave the rate out or correct it")
    return Timing(rate, Grid(rate, start_s), 0.0, certain=True, by_row=True)


def time_by_rate(path: str, rate_hz: float | None, why: str) -> Timing:
    """Use the rate that the user gives for a file without times."""
    if rate_hz is None:
        raise NeedsAnswer(Question(path, (rate_needed(),), reason=why))
    return Timing(rate_hz, Grid(rate_hz), 0.0, certain=True, given=True, by_row=True)


def clock_traps(timing: Timing) -> Iterator[Trap]:
    """Report how the times were obtained."""
    if timing.bursts is not None:
        size, interval_ms = timing.bursts.size, 1e3 * timing.bursts.interval_s
        message = (
            f"the times come in bursts of {size:.3g} samples every {interval_ms:.4g} ms; "
            f"the samples were spread evenly, at {timing.rate_hz:.6g} Hz"
        )
        yield Trap("times_in_bursts", message)
    elif timing.grid is not None:
        message = f"times are row numbers over a nominal {timing.rate_hz:g} Hz, not measured times"
        yield Trap("nominal_clock", message)
    if timing.given:
        yield Trap("rate_given", f"you stated the sampling rate: {timing.rate_hz:g} Hz")
    elif timing.steps_s is not None:
        low, high = (1e3 * step for step in timing.steps_s)
        digits = min(max(4, 1 - math.floor(math.log10((high - low) / high))), 9) if high > low else 4
        steps = f"{low:.{digits}g} to {high:.{digits}g} ms ({timing.rate_hz:.6g} Hz on average)"
        message = f"the times are measured: their steps vary from {steps}"
        yield Trap("jittered_time", message)
    elif not timing.certain:
        why = (
            "there are too few rows to be certain"
            if timing.grid is not None
            else "the times fit no regular grid and are used as printed"
        )
        yield Trap("rate_assumed", f"the rate of {timing.rate_hz:g} Hz is the most likely one: {why}")
