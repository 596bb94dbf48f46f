"""The times of lines that have no clock and no counter of the device, from the host times of the reads.

A line is no later than the read in which it arrives, and no earlier than the read before; an adapter that collects
lines hides the rest. Most boards send at an even rate, so that the time of a line is a whole number of steps, of which
lost lines take some. Where that does not hold, the lines of a read are spread backwards from its arrival.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from acquisition.block import F8, I8, U8, Block, Flag, SourceInfo
from acquisition.decoders.sensor import RESONATOR_PPM
from acquisition.live.calibration import SPEED_OF_SOUND_M_PER_S
from acquisition.live.clock_fit import NANO, fit_clock

SAME_READ = 0.25
"""Maximum time between the stamps of one read, in mean steps: a driver may hand over one burst in pieces."""
MOST_LOST = 0.15
"""Maximum share of lost lines with which an even rate is looked for."""
FEWEST_LINES = 24
"""Minimum number of lines and of reads that can show a rate."""
SEGMENT = 4096
"""Number of lines over which a rate is even to a fraction of a step; a slow drift is followed to the next ones."""
STRETCHES = 12
"""Number of stretches of a run whose earliest arrivals are compared, as in the comparison of two clocks."""
MOST_BREAKS = 0.01
"""Maximum share of reads with a line half a step before or behind what the reads allow; else no even rate holds."""
PAUSE_S, PAUSE_READS = 0.5, 4.0
"""Minimum length of a pause, s and in usual times between reads."""
BENT = 5.0
"""Minimum drift of the rate that is followed, in standard uncertainties: 1 in 4000 by chance (t, 13 degrees)."""
CLEARLY_BETTER = 10.0
"""Difference of -2 log likelihood above which the better model is very strongly supported (Kass and Raftery 1995)."""
IMPOSSIBLE, OFF_BY_ONE = 12.0, 2.3
"""Minus the log likelihood of a line too many, and of one that came with the read before or after its own, 1 in 10."""
MOST_PLACES = 8
"""Maximum number of lost lines in one read whose places are weighed."""
CRYSTAL_PPM = 30.0
"""Maximum rate error of a board's crystal at 25 degC, ppm."""
U_LOCKED_PPM = CRYSTAL_PPM * math.sqrt(2.0 / 3.0)
"""Standard uncertainty of the rates of two crystals against each other, ppm."""
NOMINAL = math.log(MOST_LOST / (2e-6 * CRYSTAL_PPM))
"""Log of the odds for two crystals at their nominal rates against any other rate that lost lines may hide.

The density of the difference of two rectangles, 1/(2 x 30 ppm) at its centre, is compared with an even one over
MOST_LOST.
"""
ADAPTER_PPM = 150.0
"""Maximum rate error of an adapter's clock against the host's, ppm: three times the 50 ppm of a crystal."""


@dataclass(frozen=True, slots=True)
class LineClock:
    """How the times of lines were found; the names are those of the provenance of a run file.

    ``steps`` is "even" for whole steps of one length, "echo" for steps that include the time of the echo, and "reads"
    for lines that were spread over the time since the read before. ``u_rate_ppm`` is the standard uncertainty of their
    rate by the host's clock, whose own is not included. ``read_s`` is the median time between reads. ``misplaced_s`` is
    the time by which lines are early or late up to the next lost line if the place of one is wrong; 0 if none can be.
    """

    steps: str
    rate_hz: float
    u_rate_ppm: float
    read_s: float
    lost: int = 0
    misplaced_s: float = 0.0

    def described(self, info: SourceInfo) -> SourceInfo:
        """Return the description of a source with the rate of its lines."""
        if not math.isfinite(self.u_rate_ppm):
            return info
        return replace(info, rate_hz=self.rate_hz, u_rate=1e-6 * self.u_rate_ppm, misplaced_s=self.misplaced_s)


UNKNOWN = LineClock("reads", math.nan, math.inf, math.nan)


class Arrivals:
    """Gives lines times by their arrival, for the display during the recording."""

    def __init__(self, rate_hz: float) -> None:
        self.clock = UNKNOWN
        self._step_s = 1.0 / rate_hz
        self._start_ns = self._last_ns = -1

    def push(self, host_ns: I8) -> tuple[F8, U8]:
        """Return times, s after the first read, and flags of the next lines."""
        if not host_ns.size:
            return np.empty(0), np.empty(0, np.uint8)
        if self._start_ns < 0:
            self._start_ns, self._last_ns = int(host_ns[0]), int(host_ns[0] - self._step_s / NANO)
        before_s = (self._last_ns - int(host_ns[0])) * NANO
        t = spread(Reads.of(host_ns), self._step_s, before_s)
        flags = gap_flags(np.diff(t, prepend=before_s), self._step_s)
        self._last_ns = int(host_ns[-1])
        return t + (int(host_ns[0]) - self._start_ns) * NANO, flags


def gap_flags(steps_s: F8, step_s: float, jitter_s: float = 0.25) -> U8:
    """Return the flags of samples by the steps before them, s: a step too long for jitter is a gap."""
    return np.where(steps_s > max(1.5 * step_s, jitter_s), np.uint8(Flag.GAP_BEFORE), np.uint8(0))


def settled(block: Block) -> tuple[Block, LineClock]:
    """Return the samples of a run, whose times are arrivals, with the times that they show together."""
    if block.host_ns is None or not len(block):
        return block, UNKNOWN
    t, clock = line_times(block.host_ns, block.distance)
    flags = block.flags & ~np.uint8(Flag.DUPLICATE_TIME | Flag.NON_MONOTONIC_TIME)
    jitter_s = 0.25 if clock.steps == "reads" else 0.0
    flags[1:] |= gap_flags(np.diff(t), 1.0 / clock.rate_hz, jitter_s) if len(block) > 1 else 0
    return replace(block, t=t, flags=flags), clock


class Reads(NamedTuple):
    """The reads that brought lines: host times, s, index of the first line of each, and number of its lines."""

    at: F8
    first: I8
    size: I8

    @classmethod
    def of(cls, host_ns: I8) -> Reads:
        """Group lines by their host times."""
        host = (host_ns - host_ns[0]) * NANO
        apart = SAME_READ * float(host[-1]) / max(host.size - 1, 1)
        first = np.concatenate([[0], np.flatnonzero(np.diff(host) > apart) + 1])
        size = np.diff(np.append(first, host.size))
        return cls(host[first + size - 1], first, size)

    @property
    def last(self) -> I8:
        """Index of the last line of each read."""
        return np.asarray(self.first + self.size - 1)


def spread(reads: Reads, step_s: float, before_s: float = -math.inf) -> F8:
    """Return times at the mean step backwards from the arrival of each read, and not before the read before it."""
    since = np.diff(reads.at, prepend=before_s)
    step = np.minimum(step_s, since / reads.size)
    back = np.repeat(reads.last, reads.size) - np.arange(reads.size.sum())
    return np.asarray(np.repeat(reads.at, reads.size) - back * np.repeat(step, reads.size))


def line_times(host_ns: I8, distance_m: F8) -> tuple[F8, LineClock]:
    """Return the times of lines, s after the first, from host times in ns and distances in m, and how they were found.

    Parameters
    ----------
    host_ns : (n,) int64
        Host times of the reads in which the lines ended.
    distance_m : (n,) float64
        Distances; NaN if unknown. They show where in a read a line was lost, and how long each echo took.

    Notes
    -----
    With step p and phase a, read j at :math:`H_j` has :math:`n_j = \\lfloor (H_j-a)/p \\rfloor - \\lfloor
    (H_{j-1}-a)/p \\rfloor` steps and :math:`m_j` lines. The likelihood of all m is greatest for the step, if each line
    is lost with the same probability. A sketch that waits for the echo has steps of :math:`p + 2 d/c`; they are even in
    the time :math:`\\int dt\\,\\bar p/p(t)`.
    """
    reads = Reads.of(host_ns)
    count, span_s = host_ns.size, float(reads.at[-1])
    mean_s = span_s / max(count - int(reads.size[0]), 1) if span_s > 0.0 else 0.0
    t = spread(reads, mean_s or 1.0)
    interval = float(np.median(np.diff(reads.at))) if reads.at.size > 1 else 0.0
    rate_hz = 1.0 / mean_s if mean_s else math.nan
    u = 1e6 * interval / (span_s * math.sqrt(reads.at.size)) if span_s else math.inf
    clock = LineClock("reads", rate_hz, u, interval)
    if min(count, reads.at.size) >= FEWEST_LINES:
        gaps = _gap_scores(distance_m)
        even, longer = _Even.of(reads, reads.at, gaps), _longer(t, distance_m, mean_s)
        echo = None
        if longer is not None and even is not None:
            support = _support_of_echo(even, reads.at, longer, t)
            if support > CLEARLY_BETTER or even.lost or even.breaks > MOST_BREAKS:
                echo = _Even.of(reads, reads.at - np.interp(reads.at, t, longer), gaps)
            if (
                echo is not None
                and even.breaks <= MOST_BREAKS
                and support + 2.0 * (even.cost - echo.cost) < CLEARLY_BETTER
            ):
                echo = None
        if longer is not None and echo is not None and echo.breaks <= MOST_BREAKS:
            t = echo.times + np.interp(echo.times, t - longer, longer)
            clock = LineClock("echo", 1.0 / echo.step_s, echo.u_ppm, interval, echo.lost, echo.misplaced_s)
        elif even is not None and even.breaks <= MOST_BREAKS:
            t = even.times
            clock = LineClock("even", 1.0 / even.step_s, even.u_ppm, interval, even.lost, even.misplaced_s)
    return t - t[0], clock


def _support_of_echo(even: _Even, at: F8, longer: F8, t: F8) -> float:
    """Return by how much reads that are late in step with the echoes support these, as -2 log likelihood."""
    known = np.column_stack([np.ones(at.size), at, np.interp(at, t, longer)])
    late = np.minimum(even.late, np.quantile(even.late, 0.9))  # a stalled link says nothing
    if not np.ptp(late) > 0.0:
        return 0.0  # every read came as early as the others, as a virtual clock has it
    weights, *_ = np.linalg.lstsq(known, late, rcond=None)
    residual, share = late - known @ weights, float(weights[2])
    u2 = float(residual @ residual) / (at.size - 3) * float(np.linalg.inv(known.T @ known)[2, 2])
    return (share**2 - (share - 1.0) ** 2) / u2


def _longer(t: F8, distance_m: F8, step_s: float) -> F8 | None:
    """Return by how much longer than even steps those with an echo took until t, s; None if echoes vary too little."""
    known = np.isfinite(distance_m)
    if known.sum() < FEWEST_LINES:
        return None
    flight_s = np.interp(t, t[known], 2.0 * distance_m[known] / SPEED_OF_SOUND_M_PER_S)
    step = step_s + flight_s - flight_s.mean()
    if flight_s.std() < 1e-3 * step_s or step.min() < 0.2 * step_s:
        return None
    rate = step_s / step
    rate /= rate.mean()
    even = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t))])
    return np.asarray(t - t[0] - even)


class _Even(NamedTuple):
    """Lines in whole steps: their times, the step, how many were lost, and how well the reads agree with them.

    ``late`` is the time from the last line of each read to its arrival, s.
    """

    times: F8
    step_s: float
    u_ppm: float
    lost: int
    late: F8
    breaks: float
    cost: float
    misplaced_s: float

    @classmethod
    def of(cls, reads: Reads, at: F8, gaps: F8) -> _Even | None:
        """Find the steps of lines that arrive with the reads ``at``, s."""
        counted = _all_arrived(reads, at)
        steps, cost = (np.arange(gaps.shape[0]), 0.0) if counted else _with_losses(reads, at, gaps)
        x = (steps - steps[0])[reads.last]
        step_s = float(at[-1] - at[0]) / float(x[-1] - x[0])
        fit = fit_clock(step_s * x, np.rint(at / NANO).astype(np.int64), step_s=step_s)
        if not math.isfinite(fit.u_rate_error_ppm):
            return None
        step_s, u_ppm = _unlocked(step_s / (1.0 + 1e-6 * fit.rate_error_ppm), fit.u_rate_error_ppm, at, x)
        lost = int(steps[-1] - steps[0]) + 1 - steps.size
        misplaced_s = step_s if lost and gaps.shape[0] > 2 * at.size else 0.0  # a read of two lines shows the place
        times = step_s * (steps - steps[0]) + _bend(at - step_s * x, x, steps - steps[0])
        late, early = at - times[reads.last], at[:-1] - times[reads.first[1:]]
        breaks = 0
        for part in _parts(at):
            # Between the reads that allow the latest and the earliest start.
            latest, earliest = late[part], early[part][: late[part].size - 1]
            start = 0.5 * float(np.quantile(latest, 0.05) + np.quantile(earliest, 0.95)) if earliest.size else latest[0]
            times[reads.first[part][0] : reads.last[part][-1] + 1] += start
            if not counted:
                breaks += int(np.count_nonzero(latest < start - 0.5 * step_s))
                breaks += int(np.count_nonzero(earliest > start + 0.5 * step_s))
        return cls(times, step_s, u_ppm, lost, late, breaks / late.size, cost, misplaced_s)


def _all_arrived(reads: Reads, at: F8) -> bool:
    """Return whether no line was lost: the earliest arrivals of all stretches then lie on one line over their count."""
    stretches = max(3, min(STRETCHES, at.size // 8))
    late, parts = at - at[-1] / reads.last[-1] * reads.last, np.array_split(np.arange(at.size), stretches)
    for _ in range(3):  # the minima are those relative to the line
        earliest = np.array([rows[np.argmin(late[rows])] for rows in parts])
        slope, start = np.polyfit(reads.last[earliest], at[earliest], 1)
        late = at - start - slope * reads.last
    minima = np.array([late[rows].min() for rows in parts])
    return bool(np.abs(minima - np.median(minima)).max() < 0.35 * slope)


def _with_losses(reads: Reads, at: F8, gaps: F8) -> tuple[I8, float]:
    """Return the steps of lines of which some were lost, and minus the log likelihood of the numbers of lines."""
    steps = np.empty(gaps.shape[0], np.int64)
    grid, ways, cost = None, _ways(reads, gaps), 0.0
    for part in _segments(reads):
        grid = _Grid.of(at[part], reads.size[part], ways[part], grid)
        cost += grid.cost
        rows = slice(int(reads.first[part][0]), int(reads.last[part][-1]) + 1)
        steps[rows] = _steps(grid, at[part], reads.size[part], gaps, rows.start)
        if rows.start:
            steps[rows] += max(0, int(steps[rows.start - 1] + 1 - steps[rows.start]))
    return steps, cost


def _parts(at: F8) -> Iterator[slice]:
    """Yield the reads between pauses, after which the lines may begin at any time."""
    between = np.diff(at)
    edges = np.flatnonzero(between > max(PAUSE_S, PAUSE_READS * float(np.median(between)))) + 1
    bounds = [0, *edges.tolist(), at.size]
    yield from (slice(a, b) for a, b in itertools.pairwise(bounds))


def _bend(late: F8, x: I8, steps: I8) -> F8 | float:
    """Return the times by which an evenly drifting rate moves the steps, s; 0 if none can be seen."""
    parts = [rows for rows in np.array_split(np.arange(late.size), 16) if rows.size]
    if len(parts) < 16:
        return 0.0
    centre = np.array([x[rows].mean() for rows in parts]) / x[-1]
    weights, covariance = np.polyfit(centre, [np.median(late[rows]) for rows in parts], 2, cov=True)
    if abs(weights[0]) < BENT * math.sqrt(covariance[0, 0]):
        return 0.0
    part = steps / x[-1]
    return np.asarray(weights[0] * part * (part - 1.0))


def _unlocked(step_s: float, u_ppm: float, at: F8, x: I8) -> tuple[float, float]:
    """Return the step and its relative uncertainty, ppm, if the adapter's clock may hide that of the board.

    An adapter hands over at whole milliseconds of its clock. If the step is also a whole number of them, all delays
    differ by whole grains, their common divisor, and a board whose clock differs a little moves no line to another
    read. Both are then assumed to keep their nominal rates as crystals do. The rate of the adapter is that at which the
    delays agree best; where that is beyond an adapter's, the lines themselves were timed. Where lines do come together,
    the board may as well have a resonator that happens to move none.
    """
    whole_s, span_s = 1e-3 * round(1e3 * step_s), float(at[-1] - at[0])
    if not whole_s or abs(step_s / whole_s - 1.0) * span_s > 3.0 * whole_s:
        return step_s, u_ppm
    rates = 1.0 + 1e-6 * np.linspace(-ADAPTER_PPM, ADAPTER_PPM, 61)
    for grain_s in sorted((1e-3 * n for n in range(1, 101) if round(1e3 * whole_s) % n == 0), reverse=True):
        late = at - whole_s * np.outer(rates, x)
        agreement = np.abs(np.exp(2j * np.pi * late / grain_s).mean(axis=1))
        best = int(np.argmax(agreement))
        if agreement[best] > 0.9 and 0 < best < rates.size - 1:
            tenth = max(at.size // 10, 1)
            moved = round(float(np.median(late[best, -tenth:]) - np.median(late[best, :tenth])) / grain_s)
            hidden = 1e6 * grain_s / span_s
            if abs(moved) > 1:
                return step_s, math.hypot(u_ppm, hidden / math.sqrt(12.0))
            shift_ppm = 0.5 * hidden * moved
            scatter = math.sqrt(max(0.0, -2.0 * math.log(agreement[best]))) / math.tau  # in grains
            u_ppm = math.hypot(U_LOCKED_PPM, scatter * hidden * math.sqrt(12.0 / at.size), 1.2 * shift_ppm)
            if x[-1] > 1.5 * at.size:
                # Of resonators up to the limit, this share moves none; their rates are a triangle of width 2 hidden.
                u_ppm = math.hypot(u_ppm, hidden * math.sqrt(hidden / (hidden + 2.0 * RESONATOR_PPM) / 6.0))
            return whole_s * float(rates[best]) * (1.0 + 1e-6 * shift_ppm), u_ppm
    return step_s, u_ppm


def _nominal(at: F8, step_s: float) -> float:
    """Return the whole number of milliseconds of the adapter's clock that a step of a board may be, s; 0 if none is."""
    between_ms = 1e3 * np.diff(at)
    whole = np.rint(between_ms)
    if not whole.size or np.abs(between_ms - whole).mean() > 0.2:  # 0.25 by chance
        return 0.0
    return round(1e3 * step_s) * float(at[-1] - at[0]) / float(whole.sum())


def _segments(reads: Reads) -> Iterator[slice]:
    """Yield the reads of consecutive segments."""
    for part in _parts(reads.at):
        lines = int(reads.last[part][-1]) + 1 - int(reads.first[part][0])
        edges = np.linspace(0, lines, max(1, round(lines / SEGMENT)) + 1)[1:-1] + reads.first[part.start]
        bounds = [part.start, *np.searchsorted(reads.first, edges).tolist(), part.stop]
        yield from (slice(a, b) for a, b in itertools.pairwise(bounds) if b > a)


class _Grid(NamedTuple):
    """Slots ``start_s + k step_s`` in which lines may be sent, and the share of them whose line was lost."""

    start_s: float
    step_s: float
    share: float
    cost: float

    @classmethod
    def of(cls, at: F8, size: I8, ways: F8, before: _Grid | None) -> _Grid:
        """Find the slots of a segment: on a coarse grid over its beginning, then on finer ones over twice as much."""
        lines = np.cumsum(size)
        stop = min(at.size, max(int(np.searchsorted(lines, 256)) + 1, 48))
        if before is None:
            mean = (at[stop - 1] - at[0]) / max(int(lines[stop - 1] - size[0]), 1)
            steps = mean * np.arange(1.02, 1.0 - MOST_LOST, -0.1 / lines[stop - 1])
            starts = at[0] - np.linspace(0.0, 1.0, 12, endpoint=False) * steps[:, None]
        else:
            steps = before.step_s * (1.0 + np.array([-2, -1, 0, 1, 2]) * 0.1 / lines[stop - 1])
            k = round((at[0] - before.start_s) / before.step_s)
            starts = (
                before.start_s + before.step_s * (k + np.linspace(-0.5, 0.5, 20, endpoint=False)) + 0.0 * steps[:, None]
            )
        while True:
            cost, share = _cost(at[:stop], size[:stop], ways[:stop], starts, steps)
            phase = np.argmin(cost, axis=1)
            each = np.arange(steps.size)
            cost, share, start = cost[each, phase], share[each, phase], starts[each, phase]
            if stop == at.size:
                break
            best = np.argsort(cost)[:40]
            stop = min(at.size, int(np.searchsorted(lines, 2 * lines[stop - 1])) + 1)
            steps = np.outer(steps[best], 1.0 + np.arange(-2, 3) * 0.05 / lines[stop - 1]).ravel()
            starts = np.repeat(start[best], 5)[:, None] + np.linspace(-0.15, 0.15, 5) * steps[:, None]
        chosen = int(np.argmin(cost))
        likeliest = cls(float(start[chosen]), float(steps[chosen]), float(share[chosen]), float(cost[chosen]))
        nominal = _nominal(at, likeliest.step_s)
        if not nominal:
            return likeliest
        starts = at[0] - np.linspace(0.0, 1.0, 60, endpoint=False) * nominal
        costs, shares = _cost(at, size, ways, starts[None], np.array([nominal]))
        chosen = int(np.argmin(costs))
        if costs[0, chosen] > likeliest.cost + NOMINAL:
            return likeliest
        return cls(float(starts[chosen]), nominal, float(shares[0, chosen]), float(costs[0, chosen]))


def _cost(at: F8, size: I8, ways: F8, starts: F8, steps: F8) -> tuple[F8, F8]:
    """Return minus the log likelihood of the numbers of lines for each step (s,) and start (s, p), and the share lost.

    A line may be early or late by its jitter, so that it comes with the read before or after: a hidden state at each
    read, of which the likeliest path counts (Viterbi's algorithm).
    """
    empty = np.diff(np.floor((at - starts[:, :, None]) / steps[:, None, None])) - size[1:]
    total, lines = np.maximum(empty.sum(axis=-1), 0.5), float(size[1:].sum())
    share = total / (lines + total)
    each, cost, before = -np.log(share), np.zeros((3, *starts.shape)), -1
    for j in np.flatnonzero(empty.any(axis=(0, 1))).tolist():
        cost[::2] += OFF_BY_ONE * (j - before - 1)  # the reads between have as many lines as slots
        before, of_lost = j, {}
        for shift in range(-2, 3):
            lost = empty[:, :, j] + shift
            place = ways[j + 1][np.clip(lost, 0, MOST_PLACES).astype(np.int64)]
            of_lost[shift] = np.where(lost >= 0.0, lost * each - place, -IMPOSSIBLE * lost)
        states = [np.minimum.reduce([cost[k] + of_lost[k - state] for k in range(3)]) for state in range(3)]
        cost = np.stack([states[0] + OFF_BY_ONE, states[1], states[2] + OFF_BY_ONE])
    return cost.min(axis=0) - lines * np.log1p(-share), share


def _ways(reads: Reads, gaps: F8) -> F8:
    """Return the log of the sum of likelihoods of all places of 0, 1, 2 ... lost lines in each read, (reads, n)."""
    odds = np.append(np.exp(gaps[:, 1:] - gaps[:, :1]), [[1.0, 1.0]], axis=0)
    ways = np.zeros((reads.size.size, MOST_PLACES + 1))
    for j, (first, last) in enumerate(zip(reads.first.tolist(), reads.last.tolist(), strict=True)):
        sums = [1.0] + [0.0] * MOST_PLACES  # elementary symmetric polynomials
        for one, two in odds[first : last + 2].tolist():
            for n in range(MOST_PLACES, 0, -1):
                sums[n] += one * sums[n - 1] + (two * sums[n - 2] if n > 1 else 0.0)
        ways[j] = np.log(np.maximum(sums, 1e-9))
    return ways


def _gap_scores(distance_m: F8) -> F8:
    """Return (n, 3): log likelihoods that the gap before each line is one, two or three steps, from the distances.

    The change of the distance across the gap is compared with those before and after it: a motion is smooth, so it is
    twice as large if a line was lost.
    """
    scores = np.zeros((distance_m.size, 3))
    change = np.diff(distance_m)
    if change.size < 3:
        return scores
    beside = 0.5 * (change[:-2] + change[2:])
    off = change[1:-1, None] - beside[:, None] * np.array([1.0, 2.0, 3.0])
    known = np.isfinite(off[:, 0])
    scale = 1.4826 * float(np.median(np.abs(off[known, 0]))) if known.any() else 0.0
    if scale > 0.0:
        scores[2:-1][known] = -np.minimum(0.5 * (off[known] / scale) ** 2, 8.0)
    return scores


def _steps(grid: _Grid, at: F8, size: I8, gaps: F8, row: int) -> I8:
    """Return the step of each line of a segment, with the likeliest places of lost lines (Viterbi's algorithm)."""
    number = np.arange(int(size.sum()))
    last = np.cumsum(size) - 1
    first = last - size + 1
    end = np.floor((at - grid.start_s) / grid.step_s).astype(np.int64)
    latest = end - last  # most lines lost before the end of a read
    earliest = np.concatenate([[latest[0]], end[:-1] + 1 - first[1:]])
    if (latest == latest[0]).all() and (earliest <= latest).all() and (earliest == latest[0]).all():
        return np.asarray(number + latest[0])
    low = np.minimum(earliest, latest) - 1
    high = np.maximum(earliest, latest) + 1
    # Where neighbouring reads leave one state only, there is nothing to choose.
    clear = (earliest == latest) & (np.diff(latest, prepend=latest[0]) == 0) & (np.diff(latest, append=latest[-1]) == 0)
    low[clear] = high[clear] = latest[clear]
    loss = -math.log(max(grid.share, 1.0 / number.size))
    jitter = 0.15 * grid.step_s
    phase = at - grid.start_s
    back: list[tuple[int, I8]] = []
    score, base = np.zeros(1), int(low[0])
    for j in range(at.size):
        base_, states = int(low[j]), np.arange(int(low[j]), int(high[j]) + 1)
        for i in range(int(first[j]), int(last[j]) + 1):
            sent = (i + states) * grid.step_s
            off = np.maximum(sent - phase[j], 0.0)
            if j:
                off = np.maximum(off, phase[j - 1] - sent)
            arrival = -np.minimum(0.5 * (off / jitter) ** 2, 50.0)
            if i == 0:
                score, base = arrival, base_
                back.append((base, np.zeros(states.size, np.int64)))
                continue
            before = base + np.arange(score.size)
            jump = states[None, :] - before[:, None]
            gap = gaps[row + i]
            value = score[:, None] + np.where(jump >= 0, gap[np.clip(jump, 0, 2)] - loss * jump, -1e6 + 1e3 * jump)
            choice = np.argmax(value, axis=0)
            back.append((base, choice))
            score, base = value[choice, np.arange(states.size)] + arrival, base_
    steps = np.empty(number.size, np.int64)
    at_state = int(np.argmax(score))
    for i in range(number.size - 1, -1, -1):
        steps[i] = i + base + at_state
        base, choice = back[i]
        at_state = int(choice[at_state])
    return steps
