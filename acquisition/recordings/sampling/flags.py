"""Find times for rows that were not read, flag repeated and backward times and gaps, and report what is peculiar."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from acquisition.block import B1, F8, I8, U8, Flag
from acquisition.recordings.recording import FormatIssue
from acquisition.recordings.sampling.timing import ChannelRows, Timing, median, snap

IRREGULAR = np.uint8(Flag.DUPLICATE_TIME | Flag.NON_MONOTONIC_TIME)
UNREAD_FLAGS = np.uint8(Flag.MALFORMED | Flag.MISSING)

_COARSE_M = 1e-3
# Minimum deviation of a lost target from the median, relative to the median deviation and to the next smaller one.
_FAR_SPREADS, _FAR_GAP = 30.0, 3.0
_SAMPLE = 65536
_FEWEST = 50  # minimum number of distances; with fewer, a common step may be accidental
_ZEROS = 10
_BACKWARD = "run backward or ahead of their neighbours"


def place_unread(t: F8, unread: B1, timing: Timing) -> F8:
    """Return the times of all rows; NaN for an unread row if nothing shows that it was a sample.

    An unread row has a time if the unread rows exactly fill the grid between two others, or if its printed time (a NaN
    if that was not read either) is the one that its row number predicts. Without a grid it must lie between the others.
    """
    out = np.where(unread, np.nan, t)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], unread.view(np.int8), [0]))))
    for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        printed_times = t[start:stop]
        before, after = t[start - 1] if start else -np.inf, t[stop] if stop < t.size else np.inf
        if timing.origin_s is None:
            out[start:stop] = np.where(
                np.isfinite(after - before) & (before < printed_times) & (printed_times < after), printed_times, np.nan
            )
            continue
        # As numbers of steps of the grid: the printed time, and what the rows above and below predict.
        first, printed, last = (timing.steps(each) for each in (before, printed_times, after))
        above, below = first + 1 + np.arange(printed_times.size), last - 1 - np.arange(printed_times.size)[::-1]
        fills = np.abs(above - below) < 0.5
        alike = (np.abs(printed - above) < 0.5) | (np.abs(printed - below) < 0.5)
        out[start:stop] = np.where(fills | alike, timing.time(np.rint(np.where(fills, above, printed))), np.nan)
    return out


def time_flags(t: F8, step: float) -> U8:
    """Flag repeated times, backward times and gaps, given the nominal time between samples (s).

    The times of samples with neither DUPLICATE_TIME nor NON_MONOTONIC_TIME increase strictly. If a single time is
    ahead of its neighbours, only that time is flagged, and not all the times after it.
    """
    flags = np.zeros(t.size, np.uint8)
    steps = np.diff(t)
    if not steps.size or (steps.min() > 0 and steps.max() <= 1.5 * step):
        return flags
    spike = np.zeros(t.size, bool)
    spike[:-1] = (t[:-1] > t[1:]) & (np.concatenate(([-np.inf], t[:-2])) < t[1:])
    reached = np.maximum.accumulate(np.where(spike, -np.inf, t))
    before = np.concatenate(([-np.inf], reached[:-1]))
    flags[spike | (t < before)] |= Flag.NON_MONOTONIC_TIME.value
    flags[~spike & (t == before)] |= Flag.DUPLICATE_TIME.value
    ahead = ~spike & (t > before)
    flags[ahead & np.isfinite(before) & (t - before > 1.5 * step)] |= Flag.GAP_BEFORE.value
    return flags


def place(rows: ChannelRows, timing: Timing) -> F8:
    """Return the time of each row in seconds, from its row number or from the printed time, snapped to the grid.

    The time of an unread row is inferred if possible, else NaN. The array of printed times may be overwritten.
    """
    unread, t = rows.unread, rows.printed
    if timing.by_row or t is None:
        t = timing.time(rows.numbers)
        t[rows.remark] = np.nan
        return t
    if timing.origin_s is not None:
        t[~unread] = snap(t[~unread], timing)[0]
    return place_unread(t, unread, timing) if unread.any() else t


def row_traps(rows: ChannelRows, timed: B1, zeros: int) -> Iterator[FormatIssue]:
    """Report the rows that could not be read; ``timed`` marks the rows with a time, which become samples."""
    if zeros:
        yield FormatIssue(
            "zero_filled_tail", f"the file ends in {zeros} zero bytes, left out: its writer was interrupted"
        )
    unread = rows.unread
    last = unread.size - 1
    if rows.cut:
        outcome = "its sample counts as missing" if timed[last] else "it was left out, because its time is unknown"
        yield FormatIssue("truncated_row", f"the last row is incomplete; {outcome}", 1, line_of(rows.lines, last))
    unread_rows = np.flatnonzero(unread[:-1] if rows.cut else unread)
    if unread_rows.size:
        first = line_of(rows.lines, int(unread_rows[0]))
        kept_rows = int(np.count_nonzero(timed[unread_rows]))
        rows_are = "1 row" if unread_rows.size == 1 else f"{unread_rows.size} rows"
        where = "" if first is None else f", the first in line {first}"
        message = f"{rows_are} could not be read{where}; {kept_rows} kept as missing samples"
        yield FormatIssue("malformed_rows", message, int(unread_rows.size), first)


def line_of(lines: I8 | None, row: int) -> int | None:
    """Return the number of the line in which a row stands; None in a binary file."""
    return None if lines is None else int(lines[row])


def sample_traps(flags: U8, t: F8, rate_hz: float, lines: I8 | None) -> Iterator[FormatIssue]:
    """Report the flagged samples, grouped by flag; ``lines`` are the line numbers of the samples."""
    if not flags.any():
        return
    kinds = (
        ("duplicate_time", Flag.DUPLICATE_TIME, "samples have the same time as an earlier one"),
        ("non_monotonic_time", Flag.NON_MONOTONIC_TIME, f"samples have times that {_BACKWARD}"),
        ("missing_samples", Flag.MISSING, "samples have no value"),
    )
    for code, flag, what in kinds:
        rows = np.flatnonzero(flags & flag.value)
        if rows.size:
            yield FormatIssue(
                code, f"{rows.size} {what}; kept and flagged", int(rows.size), line_of(lines, int(rows[0]))
            )
    gaps = np.flatnonzero(flags & Flag.GAP_BEFORE.value)
    if gaps.size:
        reached = np.maximum.accumulate(np.where(flags & IRREGULAR, -np.inf, t))
        lost = int(np.sum(np.rint((t[gaps] - reached[gaps - 1]) * rate_hz) - 1))
        gaps_are = "1 gap" if gaps.size == 1 else f"{gaps.size} gaps"
        message = f"about {lost} samples are missing in {gaps_are}; the sample after each is flagged"
        yield FormatIssue("missing_samples", message, lost, line_of(lines, int(gaps[0])))


def length_traps(distance: F8, flags: U8, resolution: float, lines: I8 | None) -> tuple[float, tuple[FormatIssue, ...]]:
    """Find zeros that fill the end, a lost target, and distances rounded more coarsely than printed.

    Zeros that fill the end become NaN and MISSING, and samples of a lost target FALSE_ECHO, in place. ``resolution``
    is the last printed digit. Return the step of which all values are multiples, and the remarks.
    """
    traps = []
    if (tail := _zero_tail(distance)) < distance.size:
        count = distance.size - tail
        distance[tail:] = np.nan
        flags[tail:] |= Flag.MISSING.value
        message = f"the last {count} distances are exactly 0, which no rangefinder reads; kept as missing samples"
        traps.append(FormatIssue("zero_filled_tail", message, count, line_of(lines, tail)))
    if (far := _far(distance, resolution)).size:
        flags[far] |= Flag.FALSE_ECHO.value
        low, high = float(np.min(distance[far])), float(np.max(distance[far]))
        distances = f"{far.size} distances of {low:.3g} to {high:.3g} m are far from all others"
        message = f"{distances}: the target was lost; kept and flagged"
        traps.append(FormatIssue("lost_target", message, int(far.size), line_of(lines, int(far[0]))))
    quantum = common_step(distance, resolution)
    if quantum >= _COARSE_M * (1 - 1e-9):
        message = f"distances are multiples of {quantum * 1e3:g} mm: smaller motion is lost by rounding"
        traps.append(FormatIssue("quantised", message, distance.size))
    return quantum, tuple(traps)


def unwrapped(values: F8, turns: Iterable[float]) -> tuple[F8, int]:
    """Return values whose jumps by one of some turns are undone, and the number of these jumps.

    Each jump is a turn but for a usual step, and all other steps are less than a quarter of it.
    """
    finite = np.flatnonzero(np.isfinite(values))
    steps = np.diff(values[finite])
    for turn in turns:
        jumps = np.abs(steps) > 0.5 * turn
        if not jumps.any() or np.ptp(values[finite]) > turn * (1 + 1e-9):
            continue
        usual = float(np.abs(steps[~jumps]).max(initial=0.0))
        if usual < 0.25 * turn and np.abs(np.abs(steps[jumps]) - turn).max() <= 1.5 * usual:
            whole = values.copy()
            whole[finite] -= turn * np.concatenate(([0.0], np.cumsum(np.sign(steps) * jumps)))
            count = int(np.count_nonzero(jumps))
            if np.ptp(whole[finite]) < turn * max(1.0, 0.5 * count):  # else it turns on and on
                return whole - turn * round(median(whole[finite]) / turn), count
    return values, 0


def _zero_tail(distance: F8) -> int:
    """Return the index of the first zero that fills the end; the number of samples if fewer than ten zeros do."""
    if distance.size <= _ZEROS or distance[-1] != 0.0 or distance[-_ZEROS:].any():
        return int(distance.size)
    nonzero = np.flatnonzero(distance != 0.0)
    return int(nonzero[-1]) + 1 if nonzero.size else int(distance.size)


def _far(distance: F8, resolution: float) -> I8:
    """Return the samples that deviate far more from the median than the others, with a gap in between.

    The size of the experiment is unknown, so there is no absolute limit. A decaying motion has no such gap.
    """
    values, no_samples = distance[:: max(1, distance.size // _SAMPLE)], np.empty(0, np.int64)
    values = values[np.isfinite(values)]
    if values.size < _ZEROS:
        return no_samples
    middle = median(values)
    threshold = _FAR_SPREADS * max(median(np.abs(values - middle)), resolution)
    deviation = np.abs(distance - middle)
    if threshold == 0.0 or not np.fmax.reduce(deviation) > threshold:
        return no_samples
    ordered = np.sort(deviation[np.isfinite(deviation)])
    first = int(np.searchsorted(ordered, threshold, side="right"))
    gaps = np.flatnonzero(ordered[first:] > _FAR_GAP * np.maximum(ordered[first - 1 : -1], threshold / _FAR_SPREADS))
    return np.flatnonzero(deviation >= ordered[first + gaps[0]]) if gaps.size else no_samples


def common_step(distance: F8, resolution: float) -> float:
    """Return the largest step of which all distances are multiples: the last printed digit or a multiple of it."""
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
