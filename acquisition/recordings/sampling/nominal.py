"""Printed times: their rate, the grid from which they were rounded, and their faults."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.block import B1, F8, I8, U8, Flag

_USUAL_RATES_HZ = (100.0, 60.0, 125.0, 50.0, 20.0, 25.0, 30.0, 40.0, 10.0, 200.0, 250.0, 500.0, 1000.0)
_SHARE_ON_GRID = 0.5
_PROBE = 2048


class Grid(NamedTuple):
    """Times ``origin_s + i / rate_hz`` for integer i."""

    rate_hz: float
    origin_s: float = 0.0

    def nearest(self, t: F8) -> I8:
        """Return the index i of the grid point nearest to each time."""
        return np.rint((t - self.origin_s) * self.rate_hz).astype(np.int64)

    def time(self, index: I8) -> F8:
        """Return the time of each index i, s."""
        return self.origin_s + index / self.rate_hz if self.origin_s else index / self.rate_hz


class Rate(NamedTuple):
    """The rate of printed times, in samples per second.

    ``relative_u`` is the relative half-width of the range of rates that are compatible with the rounding of the times.
    ``grid`` is the grid from which the times were rounded, or None if they fit no grid. The rate is ``certain`` if no
    grid with a rate one hertz higher or lower fits equally well.
    """

    rate_hz: float
    relative_u: float
    grid: Grid | None
    certain: bool


def find_rate(t: F8, resolution: float, *, rate_hz: float | None = None) -> Rate | None:
    """Infer the rate from printed times (s) with a last digit of ``resolution``; None without two different times.

    Times may repeat, run backward or be missing. If the rate is known, only grids of this rate are tried.
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
    best: Grid | None = None
    best_share = _SHARE_ON_GRID
    for origin in (0.0, float(times[0])):
        for rate in rates:
            if not _every_point(times, Grid(rate, origin)):
                continue
            share = float(np.mean(snap(probe, Grid(rate, origin), resolution)[1]))
            if share > best_share + 1e-9:
                best, best_share = Grid(rate, origin), share
            if best_share == 1.0:
                break
        if best is not None:
            break
    if best is None:
        return Rate(rough, relative_u, None, certain=False)
    beside = (Grid(best.rate_hz + off, best.origin_s) for off in (-1.0, 1.0) if best.rate_hz + off > 0)
    certain = all(np.mean(snap(probe, grid, resolution)[1]) < best_share for grid in beside)
    return Rate(best.rate_hz, relative_u, best, certain)


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


def _every_point(apart: F8, grid: Grid) -> bool:
    """Return whether consecutive times usually lie at consecutive grid points."""
    return median(np.diff(grid.nearest(apart[:_PROBE]))) == 1.0


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


def snap(t: F8, grid: Grid, resolution: float) -> tuple[F8, B1]:
    """Replace each time by the nearest grid point if the two agree within the rounding of the printed time.

    Return the times and a mask of those that agree.
    """
    exact = grid.time(grid.nearest(t))
    agrees = np.abs(exact - t) <= resolution * 0.5001
    return np.where(agrees, exact, t), agrees


def place_unread(t: F8, unread: B1, grid: Grid | None) -> F8:
    """Return the times of all rows; NaN for an unread row if nothing shows that it was a sample.

    An unread row has a time if the unread rows exactly fill the grid between two others, or if its printed time (a NaN
    if that was not read either) is the one that its row number predicts. Without a grid it must lie between the others.
    """
    out = np.where(unread, np.nan, t)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], unread.view(np.int8), [0]))))
    for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        own = t[start:stop]
        before, after = t[start - 1] if start else -np.inf, t[stop] if stop < t.size else np.inf
        if grid is None:
            out[start:stop] = np.where(np.isfinite(after - before) & (before < own) & (own < after), own, np.nan)
            continue
        # As numbers of steps of the grid: the printed time, and what the rows above and below predict.
        first, printed, last = ((each - grid.origin_s) * grid.rate_hz for each in (before, own, after))
        above, below = first + 1 + np.arange(own.size), last - 1 - np.arange(own.size)[::-1]
        fills = np.abs(above - below) < 0.5
        alike = (np.abs(printed - above) < 0.5) | (np.abs(printed - below) < 0.5)
        out[start:stop] = np.where(fills | alike, grid.time(np.rint(np.where(fills, above, printed))), np.nan)
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
