"""Find the times of samples from printed times, a formula in the header or a given rate: rate, grid and faults."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.block import B1, F8, I8
from acquisition.errors import FormatError, NeedsAnswer
from acquisition.live.clock_fit import NANO, fit_clock
from acquisition.recordings.questions import Missing, MissingItem, Question
from acquisition.recordings.recording import FormatIssue

_USUAL_RATES_HZ = (100.0, 60.0, 125.0, 50.0, 20.0, 25.0, 30.0, 40.0, 10.0, 200.0, 250.0, 500.0, 1000.0)
_SHARE_ON_GRID = 0.5
_PROBE = 2048
_PLACEHOLDER_S = 1.0  # the step that LabVIEW writes if no rate was set
_SHARE_OF_JITTER = 0.2
_ANY_RATE_HZ = 100.0  # an example: the rate of many sensors
_FEWEST_BURSTS = 20  # minimum number of bursts for which their interval can be determined
_SHORT_STEP = 0.25  # maximum step within a burst, relative to the mean step
_CLEAR_STEPS = 0.95  # minimum share of steps that are clearly within a burst or between two bursts
_REGULAR_INTERVALS = 0.9  # minimum share of intervals that differ from the median by less than half of it
_SAME_TIME = 3.0  # minimum rows per burst if all its rows have the same time; two rows may be two sensors


class Timing(NamedTuple):
    """The times ``origin_s + i / rate_hz`` of samples i; without an origin they fit no grid and are used as printed.

    ``by_row`` says that times computed from row numbers are better than the printed times. ``traps`` say how the times
    were obtained. ``u_rate`` is the relative standard uncertainty of a rate that follows from arrivals.
    """

    rate_hz: float
    origin_s: float | None
    resolution_s: float = 0.0
    by_row: bool = False
    traps: tuple[FormatIssue, ...] = ()
    u_rate: float | None = None

    def steps(self, t: Any) -> Any:
        """Return a time, or an array of times, as numbers of steps from the origin."""
        return (t - (self.origin_s or 0.0)) * self.rate_hz

    def nearest(self, t: F8) -> I8:
        """Return the index i of the grid point nearest to each time."""
        nearest: I8 = np.rint(self.steps(t)).astype(np.int64)
        return nearest

    def time(self, index: I8) -> F8:
        """Return the time of each index i, s."""
        return self.origin_s + index / self.rate_hz if self.origin_s else index / self.rate_hz


def find_rate(t: F8, resolution: float, rate_hz: float | None = None) -> tuple[Timing, float, bool] | None:
    """Infer the rate from printed times (s) with a last digit of ``resolution``; None without two different times.

    Times may repeat, run backward or be missing. If the rate is known, only grids of this rate are tried. Return the
    rate in Hz with the origin of the grid from which the times were rounded, the relative half-width of the range of
    rates that are compatible with the rounding of the times, and whether the rate is certain: no grid with a rate one
    hertz higher or lower fits equally well.
    """
    times = t if (t[1:] > t[:-1]).all() else np.unique(t[np.isfinite(t)])
    if times.size < 2:
        return None
    step, relative_u = _mean_step(times, resolution)
    rough = 1.0 / step
    nice_step = round(step / resolution) * resolution
    nice = [round(1.0 / nice_step, 9)] if nice_step > 0 else []
    tried = [rate_hz] if rate_hz else [*_USUAL_RATES_HZ, round(rough), *nice, rough]
    rates = dict.fromkeys(float(f) for f in tried if f and abs(f - rough) <= rough * relative_u * 1.5 + 1e-9)
    probe = _probe(times)

    def share(grid: Timing) -> float:
        return float(np.mean(snap(probe, grid)[1]))

    for origin in (0.0, float(times[0])):
        grids = [Timing(rate, origin, resolution) for rate in rates]
        # Consecutive times must usually lie at consecutive grid points.
        shares = {grid: share(grid) for grid in grids if median(np.diff(grid.nearest(times[:_PROBE]))) == 1.0}
        best = max(shares, key=lambda grid: shares[grid], default=None)
        if best is not None and shares[best] > _SHARE_ON_GRID:
            beside = (Timing(rate, origin, resolution) for rate in (best.rate_hz - 1.0, best.rate_hz + 1.0) if rate > 0)
            near = [grid for grid in beside if abs(grid.rate_hz - rough) <= 1.5 * rough * relative_u]
            return best, relative_u, all(share(grid) < shares[best] for grid in near)
    return Timing(rough, None, resolution), relative_u, False


def median(values: NDArray[np.number]) -> float:
    """Return the median of finite numbers; numpy's median imports numpy.ma, a tenth of the start-up time."""
    half = values.size // 2
    part = np.partition(values, half)
    return float(part[half] if values.size % 2 else 0.5 * (part[:half].max() + part[half]))


def _probe(apart: F8) -> F8:
    """Return enough times to distinguish grids: all times of a short run, or both ends and a subset of a long run."""
    if apart.size <= 4 * _PROBE:
        return apart
    return np.concatenate((apart[:_PROBE], apart[:: apart.size // _PROBE], apart[-_PROBE:]))


def _mean_step(apart: F8, resolution: float) -> tuple[float, float]:
    """Return the typical step of increasing times (s) and its relative half-width, refined over longer spans."""
    every = max(1, apart.size // _PROBE)
    step = max(median(apart[1::every] - apart[:-1:every]), resolution)
    span, relative_u = 1, resolution / step
    while (span := span * 4) < apart.size and relative_u > 1e-6:
        lengths = apart[span::every] - apart[:-span:every]
        steps = np.rint(lengths / step)
        step = median(lengths / np.maximum(steps, 1))
        relative_u = resolution / (span * step)
    if apart.size > 2:  # use the whole length if the number of steps in it is certain
        length = float(apart[-1] - apart[0])
        steps_in_all = length / step
        if steps_in_all * relative_u < 0.5 <= steps_in_all:
            step, relative_u = length / round(steps_in_all), resolution / length
    return step, relative_u


def snap(t: F8, grid: Timing) -> tuple[F8, B1]:
    """Replace each time by the nearest grid point if the two agree within the rounding of the printed time.

    Return the times and a mask of those that agree.
    """
    exact = grid.time(grid.nearest(t))
    agrees = np.abs(exact - t) <= grid.resolution_s * 0.5001
    return np.where(agrees, exact, t), agrees


@dataclass(frozen=True, slots=True)
class Formula:
    """Times ``start_s + i * step_s`` as stated in a header, and the number of samples, if the header states it."""

    start_s: float
    step_s: float
    samples: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ChannelRows:
    """The rows of one channel, before they become samples; every array has one element for each row.

    ``printed`` are the times as printed, s, or None; ``value`` the values in SI, NaN if unread or absent. ``remark``
    marks rows of text between samples, which are not samples. ``lines`` are line numbers; None in a binary file.
    ``time_resolution`` (s) and ``resolution`` are the last printed digits, the latter 0 for binary values. ``cut`` says
    that the last row is incomplete.
    """

    printed: F8 | None
    value: F8
    unread: B1
    remark: B1
    lines: I8 | None
    time_resolution: float
    resolution: float
    cut: bool = False

    @property
    def numbers(self) -> I8:
        """Sample number of each row, not counting remarks; a remark has the number of the preceding row."""
        return np.cumsum(~self.remark) - 1


def rate_needed(instead: MissingItem | None = None) -> MissingItem:
    """Return the missing item for a rate; a column of times may be given instead."""
    return MissingItem(Missing.RATE_HZ, (), _ANY_RATE_HZ, instead=instead)


def find_timing(path: str, rows: ChannelRows, formula: Formula | None, rate_hz: float | None) -> Timing:
    """Return the rate and the grid of the times: those of the header if no column contradicts it, or of the column.

    Without any times the user must give the rate.
    """
    traps: list[FormatIssue] = []
    timing = None
    if formula is not None:
        samples, count = formula.samples, int(np.count_nonzero(~rows.remark))
        if samples is not None and samples != count:
            message = f"the header declares {samples} samples, but there are {count} rows; all are kept"
            traps.append(FormatIssue("stale_header", message, abs(samples - count)))
        timing = _by_formula(path, formula, rows, rate_hz)
        if formula.step_s == _PLACEHOLDER_S and rate_hz is None and rows.printed is None:
            steps = "the header states steps of 1 s, as LabVIEW does if no rate was set"
            traps.append(FormatIssue("rate_assumed", f"{steps}; if they are not, state the rate"))
        if timing is None:
            formula_words = f"the header states the times {formula.start_s:g} s + i * {formula.step_s:g} s"
            what = "which are impossible" if rows.printed is None else "but the column of times differs and is used"
            size = 1 if rows.printed is None else rows.printed.size
            traps.append(FormatIssue("stale_header", f"{formula_words}, {what}", size))
    if timing is None and rows.printed is not None:
        printed = rows.printed[~rows.unread]
        timing = _in_bursts(path, printed, rows.time_resolution, rate_hz)
        timing = timing or _by_column(path, printed, rows.time_resolution, rate_hz)
    if timing is None:
        if rate_hz is None:
            reason = "no column of times and no sampling interval"
            raise NeedsAnswer(Question(path, (rate_needed(),), reason=reason))
        timing = Timing(rate_hz, 0.0, by_row=True, traps=_nominal(rate_hz))
    given = () if rate_hz is None else (FormatIssue("rate_given", f"you stated the sampling rate: {rate_hz:g} Hz"),)
    return timing._replace(traps=(*traps, *timing.traps, *given))


def _nominal(rate_hz: float) -> tuple[FormatIssue]:
    return (FormatIssue("nominal_clock", f"times are row numbers over a nominal {rate_hz:g} Hz, not measured times"),)


def _by_formula(path: str, formula: Formula, rows: ChannelRows, rate_hz: float | None) -> Timing | None:
    """Return the times of a header; None if they are impossible or the column of times differs beyond its rounding."""
    start_s, step_s = formula.start_s, formula.step_s
    if not (math.isfinite(start_s) and math.isfinite(step_s) and 1e-12 < step_s < 1e12):
        return None
    if rows.printed is not None:
        expected = start_s + step_s * rows.numbers
        slack = 0.5001 * rows.time_resolution + 1e-9 * np.maximum(np.abs(expected), step_s)
        if ((np.abs(rows.printed - expected) > slack) & ~rows.unread).any():  # the comparison is false for a NaN
            return None
    rate = 1.0 / step_s
    rounded = float(f"{rate:.9g}")
    rate = rounded if math.isclose(rounded, rate, rel_tol=1e-12) else rate
    if rate_hz is not None and step_s == _PLACEHOLDER_S:
        rate = rate_hz
    if rate_hz is not None and abs(rate - rate_hz) > 1e-6 * rate:
        problem = f"rate_hz must agree with the header, {rate:.6g} Hz, got {rate_hz:g}"
        raise FormatError(path, problem, "leave the rate out or correct it")
    return Timing(rate, start_s, by_row=True, traps=_nominal(rate))


def _by_column(path: str, printed: F8, resolution: float, rate_hz: float | None) -> Timing:
    """Infer the rate from the printed times (s) of valid rows; ask for it if they do not show it."""
    fitted = find_rate(printed, resolution, rate_hz)
    if fitted is None:
        if rate_hz is None:
            reason = f"expected different times, got {printed.size} rows at one time"
            raise NeedsAnswer(Question(path, (rate_needed(),), reason=reason))
        origin = float(printed[0]) if printed.size else 0.0
        return Timing(rate_hz, origin, resolution, traps=_nominal(rate_hz))
    timing, relative_u, certain = fitted
    rate, on_grid = timing.rate_hz, timing.origin_s is not None
    jitter = None if on_grid else _jitter(printed)
    if rate_hz is not None:
        allowed = rate_hz * (1.5 * relative_u + 1e-6 + (0.01 if jitter else 0.0))
        if abs(rate - rate_hz) > allowed:
            problem = f"rate_hz must agree with the times, {rate:.6g} Hz, got {rate_hz:g}"
            raise FormatError(path, problem, "leave the rate out or correct it")
        return timing._replace(rate_hz=rate_hz, traps=_nominal(rate_hz) if on_grid else ())
    if not on_grid:
        measured = f"are measured: their steps vary from {jitter}"
        times = measured if jitter else "fit no regular grid and are used as printed"
        return timing._replace(traps=(FormatIssue("jittered_time", f"the times {times} ({rate:.6g} Hz on average)"),))
    likely = f"the rate of {rate:g} Hz is the most likely one: there are too few rows to be certain"
    assumed = () if certain else (FormatIssue("rate_assumed", likely),)
    return timing._replace(traps=(*_nominal(rate), *assumed))


def _jitter(printed: F8) -> str:
    """Return the 5th and 95th percentiles of the time steps if these differ little; else an empty text."""
    steps = np.diff(printed)
    steps = steps[steps > 0]
    if steps.size < 2:
        return ""
    low, middle, high = (1e3 * float(x) for x in np.percentile(steps, (5, 50, 95)))
    digits = min(max(4, 1 - math.floor(math.log10((high - low) / high))), 9) if high > low else 4
    return f"{low:.{digits}g} to {high:.{digits}g} ms" if high - low <= _SHARE_OF_JITTER * middle else ""


def _in_bursts(path: str, t: F8, resolution: float, rate_hz: float | None) -> Timing | None:
    """Return evenly spaced times for times (s) that come in regular bursts; None for other times.

    A computer that polls a sensor, or gets its samples in packets, stamps each sample when it arrives. The stamps of
    one packet lie close together and contain no information on when its samples were taken. The stamps of the last
    samples of the packets do, compared with the row numbers as the clocks of a sensor and a computer are: this gives
    the rate with its uncertainty.
    """
    if t.size < 2 * _FEWEST_BURSTS or not np.isfinite(t).all():
        return None
    steps = np.diff(t)
    mean = float(t[-1] - t[0]) / steps.size
    if not mean > 0.0 or steps.min() < 0.0:
        return None
    within, between = steps < _SHORT_STEP * mean, steps >= mean
    last: I8 = np.flatnonzero(between)
    few = last.size < _FEWEST_BURSTS or np.count_nonzero(within) < 0.5 * (steps.size - 1)
    if few or np.mean(within | between) < _CLEAR_STEPS:
        return None
    intervals = np.diff(t[last])
    interval = median(intervals)
    size = t.size / (last.size + 1)
    regular = np.mean(np.abs(intervals - interval) < 0.5 * interval) >= _REGULAR_INTERVALS
    if not regular or (size < _SAME_TIME and not steps[within].any()):
        return None
    step, start = (float(each) for each in np.polyfit(last, t[last], 1))
    bursts = f"bursts of {size:.3g} samples every {1e3 * interval:.4g} ms"
    # Samples are missing if the last stamp of a burst is further than one interval from its evenly spaced time.
    if rate_hz is None and np.abs(t[last] - (start + step * last)).max() >= interval:
        raise NeedsAnswer(Question(path, (rate_needed(),), reason=f"the times come in {bursts}, some missing"))
    last_ns, u_rate = np.rint(t[last] / NANO).astype(np.int64), None
    fit = fit_clock(np.asarray(step * last, np.float64), last_ns, step_s=step)
    if rate_hz is None and math.isfinite(fit.u_rate_error_ppm):
        step, u_rate = step / (1.0 + 1e-6 * fit.rate_error_ppm), 1e-6 * fit.u_rate_error_ppm
        start = float(np.mean(t[last] - step * last))
    rate = rate_hz or 1.0 / step
    message = f"the times come in {bursts}; the samples were spread evenly, at {rate:.6g} Hz"
    traps = (FormatIssue("times_in_bursts", message),)
    return Timing(rate, start, resolution, by_row=True, traps=traps, u_rate=u_rate)
