"""Rows: records whose rows are not one after another in time, told from the distances alone."""

from __future__ import annotations

import numpy as np

from pipeline.numerics.robust import mad_sigma
from pipeline.oscillation.condition import FOURTH_DIFFERENCE_GAIN, Conditioned
from pipeline.track import F8, Track

__all__ = ["are_interleaved", "count_lost"]

SIGMAS = 8.0  # of the noise that a step between rows must have to be told from two steps
ALIKE = 0.7  # correlation of what alternates, from row to row
LEAST = 64  # rows
LEAST_SHARE = 0.015  # of the rows
MANY = 0.1  # of the rows: so many that the steps around are often two at once themselves
SLOW = 0.25  # of the fastest steps: below, near a turning point, a lost row is no more than noise
MOST = 5.0  # steps at once: more are no rows lost but something else


def are_interleaved(track: Track) -> bool:
    """Return whether the rows are of two records in turn.

    Notes
    -----
    What every row is off the mean of its neighbours, with the sign changed from row to row, is correlated over three
    to nine rows where two records alternate; of one record's white noise it is not.
    """
    y = track.y[np.isfinite(track.y)]
    if y.size < LEAST:
        return False
    off = y[1:-1] - 0.5 * (y[:-2] + y[2:])
    off[::2] *= -1.0
    power = float(off @ off) / off.size
    return power > 0.0 and all(float(off[lag:] @ off[:-lag]) > ALIKE * power * (off.size - lag) for lag in (3, 5, 7, 9))


def count_lost(conditioned: Conditioned) -> int:
    """Return how many rows were lost while times were counted on; 0 where that cannot be told from noise.

    Notes
    -----
    Where a row is missing the distance makes two steps at once: twice the median of the two before and the two after.
    Where every fifth row and more is missing, that median is often of two steps itself, and the lesser of the middle
    two of the four is taken. Where times jitter, or values are held, as many steps are too short. The noise is that
    near the turning points, where a lost row moves little.
    """
    track, used = conditioned.track, conditioned.used
    step: F8 = np.diff(track.y)
    sound = used[1:] & used[:-1] & (np.abs(np.diff(track.t) * track.rate_hz - 1.0) < 0.2)
    if step.size < LEAST:
        return 0
    four = np.sort([step[:-4], step[1:-3], step[3:-1], step[4:]], axis=0)
    whole = np.logical_and.reduce([sound[k : sound.size - 4 + k] for k in range(5)])
    if not whole.any():
        return 0
    median, lesser = 0.5 * (four[1] + four[2]), np.where(four.sum(axis=0) > 0.0, four[1], four[2])
    fast = float(np.quantile(np.abs(median[whole]), 0.9))
    slow = np.diff(step, 3)[:-1][whole & (np.abs(median) < SLOW * fast)]
    noise_m = float(mad_sigma(slow) / FOURTH_DIFFERENCE_GAIN) if slow.size >= LEAST else conditioned.noise_m
    for around, least, times in ((lesser, MANY, 3), (median, LEAST_SHARE, 5)):
        clear = whole & (np.abs(around) > np.maximum(SIGMAS * noise_m, 0.5 * fast))
        ratio = step[2:-2][clear] / around[clear]
        # Only in the fast part of a period are two steps told from one.
        many = np.where(ratio < MOST, np.rint(np.maximum(ratio - 0.1, 1.0)) - 1.0, 0.0)
        lost, short = np.count_nonzero(many), np.count_nonzero(ratio < 0.4)
        if lost >= max(5, least * ratio.size) and lost > times * short:
            return round(float(many.mean()) * track.y.size)
    return 0
