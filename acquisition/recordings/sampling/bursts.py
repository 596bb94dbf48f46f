"""Find bursts of times, as stamped by a computer that reads several samples together, and the even sampling times."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from acquisition.block import F8, I8
from acquisition.recordings.sampling.nominal import median

_FEWEST = 20  # minimum number of bursts for which their interval can be determined
_SHORT = 0.25  # maximum step within a burst, relative to the mean step
_CLEAR = 0.95  # minimum share of steps that are clearly within a burst or between two bursts
_REGULAR = 0.9  # minimum share of intervals that differ from the median by less than half of it
_SAME_TIME = 3.0  # minimum rows per burst if all its rows have the same time; two rows may be two sensors


class Bursts(NamedTuple):
    """Samples that were stamped in bursts of ``size`` on average, one every ``interval_s``.

    Spread evenly, they are ``step_s`` apart and begin at ``first_s``. They are ``complete`` if the last stamp of every
    burst lies within one interval of its evenly spaced time; otherwise samples are missing somewhere.
    """

    size: float
    interval_s: float
    step_s: float
    first_s: float
    complete: bool


def find_bursts(t: F8) -> Bursts | None:
    """Find bursts in the printed times of a recording (s); None for times that do not come in regular bursts.

    A computer that polls a sensor, or gets its samples in packets, stamps each sample when it arrives. The stamps of
    one packet lie close together and contain no information on when its samples were taken. The stamps of the last
    samples of the packets do: a straight line fitted to them against the row numbers gives the rate and the start.
    """
    if t.size < 2 * _FEWEST or not np.isfinite(t).all():
        return None
    steps = np.diff(t)
    mean = float(t[-1] - t[0]) / steps.size
    if not mean > 0.0 or steps.min() < 0.0:
        return None
    within, between = steps < _SHORT * mean, steps >= mean
    if np.count_nonzero(within) < 0.5 * (steps.size - 1) or np.mean(within | between) < _CLEAR:
        return None
    last: I8 = np.flatnonzero(between)
    if last.size < _FEWEST:
        return None
    intervals = np.diff(t[last])
    interval = median(intervals)
    size = t.size / (last.size + 1)
    if np.mean(np.abs(intervals - interval) < 0.5 * interval) < _REGULAR:
        return None
    if size < _SAME_TIME and not steps[within].any():
        return None
    step, start = (float(each) for each in np.polyfit(last, t[last], 1))
    late = np.abs(t[last] - (start + step * last))
    return Bursts(size, interval, step, start, bool(late.max() < interval))
