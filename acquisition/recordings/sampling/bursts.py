"""Find bursts of times, as stamped by a computer that reads several samples together, and the even sampling times."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from acquisition.block import F8, I8
from acquisition.recordings.sampling.nominal import median

__all__ = ["Bursts", "find_bursts"]

_FEWEST = 20  # minimum number of bursts for which their interval can be determined
_SHORT = 0.25  # maximum step within a burst, relative to the mean step
_CLEAR = 0.95  # minimum share of steps that are clearly within a burst or between two bursts
_REGULAR = 0.9  # minimum share of intervals that differ from the median by less than half of it
_SAME_TIME = 3.0  # minimum rows per burst if all its rows have the same time; two rows may be two sensors


class Bursts(NamedTuple):
    """Properties of samples that were stamped in bursts.

    Parameters
    ----------
    size : float
        Samples per burst, on average.
    interval_s : float
        Interval from one burst to the next, s.
    step_s, first_s : float
        Interval between the samples if they are spread evenly, and the time of the first sample, s.
    complete : bool
        Whether the last stamp of every burst lies within one interval of its evenly spaced time. Otherwise samples are
        missing somewhere.
    """

    size: float
    interval_s: float
    step_s: float
    first_s: float
    complete: bool


def find_bursts(t: F8) -> Bursts | None:
    """Find bursts in the times of a recording.

    Parameters
    ----------
    t : (n,) float64, s
        Times as printed.

    Returns
    -------
    Bursts or None
        None for times that do not come in regular bursts.

    Notes
    -----
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
